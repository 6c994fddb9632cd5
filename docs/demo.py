"""The live page as a part of the site: `python docs/demo.py docs/_build/live`.

The page runs in the visitor's browser, so that any web host of the site has a working demo. Without
the npm registry, which has the runtime, the site is built all the same, and a page says what is
missing.
"""

import sys
from pathlib import Path

from lime_keras.io import atomic
from lime_keras.live import static
from lime_keras.model import folder as model_folder

_WRITTEN = "engine.json"
"""A file that only a whole page has."""
_MISSING = """<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>lime_keras: the demo is missing</title>
<body style="max-width: 40em; margin: 3em auto; padding: 0 1em; font-family: sans-serif">
<h1>The demo is missing</h1>
<p>This copy of the site was built without the npm registry, which has the runtime of the demo.
Run <code>make docs</code> again with a network, or <code>lime-live</code> on your computer.</p>
<p><a href="../index.html">Back to the documentation</a></p>
"""


def main(out: Path) -> None:
    """Write the page with the default weights into a folder of the site, or say why it cannot be.

    Args:
        out: folder of the page; one from an earlier build is replaced, or kept without a network.
    """
    try:
        runtime = static.fetched_runtime()
        if not (out / _WRITTEN).exists():
            # A page that says what is missing, which is nobody's work.
            (out / "index.html").unlink(missing_ok=True)
        static.write(out, model_folder.DEFAULT, runtime)
    except OSError as error:
        print(f"the demo of the site is not written anew: {error}", file=sys.stderr)
        if not (out / _WRITTEN).exists():
            out.mkdir(parents=True, exist_ok=True)
            atomic.write(out / "index.html", _MISSING)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
