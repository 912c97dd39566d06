"""``python -m armkin``."""

from armkin.cli import main

if __name__ == "__main__":
    main()
