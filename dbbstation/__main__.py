"""`python -m dbbstation` is the same as `dbbstation`."""

from dbbstation.cli import main

if __name__ == "__main__":
    main()
