"""A host of SSH on this machine, for tests."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest


@dataclass(frozen=True, slots=True)
class Host:
    """A folder that is the root of an address, ssh://me@127.0.0.1:PORT."""

    address: str
    loop: asyncio.AbstractEventLoop
    connections: list[Any] = field(default_factory=list)

    def hang_up(self) -> int:
        """Cut all connections there are; how many they were."""

        async def cut() -> int:
            count = len(self.connections)
            while self.connections:
                self.connections.pop().abort()
            return count

        return asyncio.run_coroutine_threadsafe(cut(), self.loop).result(30)


@contextmanager
def ssh_host(folder: Path, home: Path, *, jumps: list[int] | None = None) -> Generator[Host]:
    """A host, until the end of the block, which whoever has this home is known to, and knows.

    With a list of `jumps` one may go on to other ports of this machine from there, and each that was gone to is noted.
    """
    pytest.importorskip("fsspec")
    # What fsspec opens such addresses with, and the other end of it.
    pytest.importorskip("paramiko")
    asyncssh: Any = pytest.importorskip("asyncssh")
    connections: list[Any] = []
    hosts = asyncssh.generate_private_key("ssh-ed25519")
    keys = home / ".ssh"
    keys.mkdir(parents=True, exist_ok=True)
    if not (keys / "id_ed25519").exists():
        asyncssh.generate_private_key("ssh-ed25519").write_private_key(keys / "id_ed25519")
    own = asyncssh.read_private_key(keys / "id_ed25519")

    class Guard(asyncssh.SSHServer):
        def connection_made(self, conn: Any) -> None:
            connections.append(conn)

        def begin_auth(self, username: str) -> bool:
            return True

        def public_key_auth_supported(self) -> bool:
            return True

        def validate_public_key(self, username: str, key: Any) -> bool:
            return username == "me" and key.public_data == own.public_data

        def connection_requested(self, dest_host: str, dest_port: int, orig_host: str, orig_port: int) -> bool:
            if jumps is not None:
                jumps.append(dest_port)
            return jumps is not None

    def serve(channel: Any) -> Any:
        return asyncssh.SFTPServer(channel, chroot=str(folder))

    async def listen() -> Any:
        return await asyncssh.create_server(
            Guard,
            "127.0.0.1",
            0,
            server_host_keys=[hosts],
            sftp_factory=serve,
        )

    async def leave() -> None:
        server.close()
        others = asyncio.all_tasks() - {asyncio.current_task()}
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)

    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever, daemon=True)
    thread.start()
    server = asyncio.run_coroutine_threadsafe(listen(), loop).result(30)
    try:
        port = server.sockets[0].getsockname()[1]
        public = hosts.export_public_key().decode()
        with (keys / "known_hosts").open("a", encoding="utf-8") as known:
            known.write(f"[127.0.0.1]:{port} {public}")
        yield Host(f"ssh://me@127.0.0.1:{port}", loop, connections)
    finally:
        asyncio.run_coroutine_threadsafe(leave(), loop).result(30)
        loop.call_soon_threadsafe(loop.stop)
        thread.join(10)
