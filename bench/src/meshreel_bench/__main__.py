"""`python -m meshreel_bench`: the command line of the bench."""

from .cli import main

if __name__ == "__main__":
    main()
