"""FastAPI routes whose bodies are bounded, and typed by msgspec as all of the protocol."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Callable, Coroutine
from typing import Annotated, Any, TypeVar, cast

import msgspec
from fastapi import Body
from fastapi.routing import APIRoute
from pydantic import GetCoreSchemaHandler
from pydantic_core import CoreSchema, core_schema
from starlette.requests import ClientDisconnect, Request
from starlette.responses import Response
from starlette.types import Scope

from server.security.least_role import RefusedRequest

MAX_BODY, BODY_S = 4_096, 5.0
"""Bytes, and seconds until all of them have come."""
FIELD = re.compile(r"(?:\$\.|field `)(\w+)")
"""Where msgspec's complaint names it."""
Kind = TypeVar("Kind")


async def body_of(request: Request, longest: int = MAX_BODY) -> bytes:
    """The body.

    Raises:
        RefusedRequest: it is longer than what we take, or too long in coming.
    """
    body = b""
    try:
        async with asyncio.timeout(BODY_S):
            async for part in request.stream():
                body += part
                if len(body) > longest:
                    raise RefusedRequest(400, "body", f"up to {longest} bytes")
    except (TimeoutError, ClientDisconnect) as error:
        raise RefusedRequest(400, "body", f"all of it within {BODY_S:g} s") from error
    return body


class WholeRequest(Request):
    """A request whose body has come; it goes on as bytes, and its type decodes it, strictly."""

    def __init__(self, scope: Scope, body: bytes) -> None:
        super().__init__(scope)
        self._whole = body or b"null"

    async def body(self) -> bytes:
        """All of it; null if there is none."""
        return self._whole

    async def json(self) -> bytes:
        """The same, whatever its content type says."""
        return self._whole


class ApiRoute(APIRoute):
    """A route whose body, if it takes one, is bounded in length and time."""

    longest = MAX_BODY
    """[bytes]"""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """FastAPI's handler, behind the reading."""
        handle = super().get_route_handler()
        if self.body_field is None:
            return handle

        async def bounded(request: Request) -> Response:
            body = await body_of(request, self.longest)
            return await handle(WholeRequest(request.scope, body))

        return bounded


class ByMsgspec:
    """Annotation of a type that msgspec decodes, encodes and describes in OpenAPI."""

    def __get_pydantic_core_schema__(
        self, source: type, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """What pydantic does with a value of type `source`."""
        decoder: msgspec.json.Decoder[Any] = msgspec.json.Decoder(source)

        def decoded(value: object) -> object:
            """A body is bytes; an answer is a value already."""
            if not isinstance(value, bytes):
                return value
            try:
                return decoder.decode(value)
            except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
                raise _misshapen(source, str(error)) from error

        return core_schema.no_info_plain_validator_function(
            decoded,
            metadata={"source": source},
            serialization=core_schema.plain_serializer_function_ser_schema(msgspec.to_builtins),
        )

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: object) -> dict[str, Any]:
        """For OpenAPI."""
        return schema_of(schema["metadata"]["source"])


Asked = Annotated[Kind, ByMsgspec(), Body()]
"""The body of a request."""
Reply = Annotated[Kind, ByMsgspec()]
"""The body of an answer."""


def schema_of(kind: type) -> dict[str, Any]:
    """JSON schema of a struct, in one piece."""
    schema = msgspec.json.schema(kind)
    parts = schema.pop("$defs", {})

    def whole(node: object) -> object:
        if isinstance(node, list):
            return [whole(one) for one in node]
        if not isinstance(node, dict):
            return node
        if "$ref" in node:
            return whole(parts[node["$ref"].rpartition("/")[2]])
        return {key: whole(value) for key, value in node.items()}

    return cast(dict[str, Any], whole(schema))


def _misshapen(kind: type, complaint: str) -> RefusedRequest:
    """Names the field that is wrong, and what all of them may be."""
    schema = schema_of(kind)
    [shape] = [one for one in schema.get("anyOf", [schema]) if "properties" in one]
    fields = shape["properties"]
    named = FIELD.search(complaint)
    values = ", ".join(f'"{name}": {_example(one)}' for name, one in fields.items())
    return RefusedRequest(400, named[1] if named else next(iter(fields)), f"JSON: {{{values}}}")


def _example(schema: dict[str, Any]) -> str:
    """What a field may be, as people write it."""
    first = schema.get("anyOf", [schema])[0]
    if "enum" in first:
        return " or ".join(map(json.dumps, first["enum"]))
    return {"string": '"…"', "boolean": "true or false"}.get(first["type"], "a number")
