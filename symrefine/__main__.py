"""`python -m symrefine` is the command `symrefine`."""

from symrefine.cli import main

if __name__ == "__main__":
    main()
