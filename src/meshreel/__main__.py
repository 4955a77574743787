"""`python -m meshreel`, and the command `meshreel`: the command line."""

import signal

if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # until `main` handles it: Ctrl-C in an import gives no traceback

from .cli import main

if __name__ == "__main__":
    main()
