"""Web server of the player for `meshreel play` and `meshreel serve`. In: .reel files. Out: HTTP.

Needs the extra `play` (starlette, uvicorn, trustme).
"""
