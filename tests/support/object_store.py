"""An S3 server on this machine, for tests."""

from __future__ import annotations

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
