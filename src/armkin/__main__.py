"""``python -m armkin``."""

import sys

from armkin.cli import main

if __name__ == "__main__":
    sys.exit(main())
