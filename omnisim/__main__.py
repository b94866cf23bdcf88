"""The command line, as `python -m omnisim`."""

from omnisim.apps.cli.start import main

if __name__ == "__main__":
    main()
