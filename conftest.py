"""The same tests wherever they are run.

Property tests draw the same examples every time where CI is set, new ones everywhere else. And Ctrl-C reaches the
programs that tests start: whatever is started in the background of a shell ignores it, and so do its children.
"""

import os
import signal

from hypothesis import settings

settings.register_profile("ci", derandomize=True)
if os.environ.get("CI"):
    settings.load_profile("ci")

signal.signal(signal.SIGINT, signal.default_int_handler)
