# SPDX-License-Identifier: Apache-2.0
"""The handlers of HTTP requests, a module for each topic. Each is a coroutine of the server and the request, and of the
spacecraft if its path names one, for which the user has the role of the handler's @route.

    @route("GET", "/api/crafts/{c}/sessions", "view")
    async def sessions(server: Server, _: web.Request, craft: Spacecraft) -> web.StreamResponse:
        return await server.query(lambda: json_answer(craft.past.sessions()))
"""
from fledge.ground.server.handlers import commands, crafts, past, run, services, site

TOPICS = (crafts, commands, past, services, run, site)
