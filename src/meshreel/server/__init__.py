"""The web server of the player: `meshreel play` and `meshreel serve`. In: .reel files. Out: HTTP.

Needs the extra `play` (starlette, uvicorn, trustme), and for posters the extra `encode`.
"""
