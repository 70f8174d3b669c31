"""The passes, as rules that ask each other: forward, loads, forces, reduction."""
