"""What a recording holds, as one number: what is measured against it holds for as long as that stays."""

from __future__ import annotations

import dataclasses
import hashlib
import json

from gasp_core.recording.reader import Recording

__all__ = ["content_digest"]


def content_digest(recording: Recording) -> str:
    """SHA-256 of what decides the frames that there are, and of their checksums; wherever the recording lies.

    No chunk is read: a commit knows those of its frame. Of a frame from before version 6, which has no checksums, the
    displacements are.

    Raises
    ------
    RecordingError
        Where a frame is lost.
    """
    header = recording.header
    digest = hashlib.sha256()

    def add(*told: object) -> None:
        digest.update(json.dumps(told, sort_keys=True).encode() + b"\n")

    add(header.scene_digest, header.points_digest, header.frame_rate, dataclasses.asdict(header.engine))
    add([dataclasses.asdict(body) for body in header.bodies], dict(header.files))
    for frame in range(recording.frame_count):
        commit = recording.commit(frame)
        chunks = {key: (check.size, check.checksum) for key, check in commit.chunks.items()}
        add(frame, commit.time, chunks, commit.body_displacements, commit.degenerate)
        if not header.files:
            digest.update(recording.displacements(frame)[0].tobytes())
    return digest.hexdigest()
