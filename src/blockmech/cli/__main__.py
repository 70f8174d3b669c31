"""``python -m blockmech.cli``, where the installed command is not on the path."""

import sys

from blockmech.cli import main

if __name__ == "__main__":
    sys.exit(main())
