"""Check of a graphics card in minutes: `python -m tests.drivers gpu --out FILE.tar`.

Each step is a process with a time limit. After it the card's health is checked, and new errors of
the kernel's log are kept. Steps that once made a card stall come last. See `plan` for the steps.
"""

SECONDS = 480.0  # time limit of the whole
