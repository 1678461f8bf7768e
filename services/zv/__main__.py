"""``python -m zv`` is ``zv``."""

from zv.cli.main import main

if __name__ == "__main__":
    main()
