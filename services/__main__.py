"""``python -m services`` is ``zv``."""

from services.cli.main import main

if __name__ == "__main__":
    main()
