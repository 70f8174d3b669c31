"""What every room stands on: numbers, places, units, messages, files."""
