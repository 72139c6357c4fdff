"""Start Scene from a checkout: `python app.py` is the command `scene`."""

from web_panels.main import main

if __name__ == "__main__":
    main()
