"""The game in the browser: `python -m airhockey_env.web` prints an address to open. It needs the extra "web".

The server plays and the pages draw: nothing of the game is calculated in the browser. A page opens one WebSocket, which
is its session, and everything that a session does is an answer to a message of its own page (see `sessions.base`). So a
page that asks rarely costs little, and one that reads slowly holds up nobody but itself.
"""
