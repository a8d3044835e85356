"""The same tests wherever they are run.

Property tests draw the same examples every time where CI is set, new ones everywhere else, and none fails because the
machine is busy. And Ctrl-C reaches the programs that tests start: whatever is started in the background of a shell
ignores it, and so do its children.
"""

import os
import signal

from hypothesis import settings

settings.register_profile("own", deadline=None)
settings.register_profile("ci", deadline=None, derandomize=True)
settings.load_profile("ci" if os.environ.get("CI") else "own")

signal.signal(signal.SIGINT, signal.default_int_handler)
