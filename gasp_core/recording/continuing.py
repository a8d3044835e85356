"""Whether a recording can be gone on with: whether all that decides its frames is still what it was."""

from __future__ import annotations

import dataclasses
from typing import Any

from gasp_core.contract import EngineDescriptor
from gasp_core.contract.options import build_options, chosen_options
from gasp_core.errors import RecordingError, SceneError
from gasp_core.recording.layout import EngineRecord, Header
from gasp_core.recording.reader import Recording
from gasp_core.scene.digest import scene_digest

__all__ = ["refuse_other"]

_LONGEST = 60
"""Characters of an option's value in a message."""
_ADVICE = "run it anew, or under another name"


def refuse_other(
    found: Recording, wanted: Header, descriptor: EngineDescriptor, options: Any, *, velocities: bool, frames: int
) -> None:
    """Refuse to go on with a recording of another scene, engine or set of points, one of less, or one of more frames.

    Parameters
    ----------
    found
        What is there, written by whatever version of this program.
    wanted
        The header that a new run would begin with.
    descriptor, options
        The engine that would go on, and its options.
    velocities
        Whether frames are to have these too.
    frames
        How many there are to be in the end.

    Raises
    ------
    RecordingError
        Where something that decides the frames is not what it was, or its frames lack what is asked for; the message
        says what.
    """
    path, header = found.path, found.header
    if header.scene_digest != wanted.scene_digest:
        _refuse_other_scene(found, wanted)
    changed = _changes(header.engine, wanted.engine, descriptor, options)
    if changed:
        raise RecordingError(
            f"{path}: the engine is not the one it was recorded with ({', '.join(changed)}): {_ADVICE}"
        )
    if header.points_digest != wanted.points_digest:
        raise RecordingError(
            f"{path}: this GASP ({wanted.gasp_version}) makes other points of the scene than the one that recorded it"
            f" ({header.gasp_version}), on this processor at least: {_ADVICE}"
        )
    if found.frame_count > frames:
        # None is taken away that somebody has waited for, and a status of fewer would contradict what is there.
        longest = (found.frame_count - 1) / header.frame_rate
        raise RecordingError(
            f"{path}: has {found.frame_count} frames, and the scene would have {frames}: none of them is taken back;"
            f" let it last at least as long, scene.duration = {longest!r}, or {_ADVICE}"
        )
    if velocities and not found.has_velocities:
        # All frames have them or none.
        raise RecordingError(
            f"{path}: was begun without velocities, and frames cannot have them from the middle on: leave"
            f" velocities = true of [recording] out, or {_ADVICE}"
        )


def _refuse_other_scene(found: Recording, wanted: Header) -> None:
    """Refuse unless the scene that was kept, read as scenes are read today, is the one that is wanted.

    The digest of an earlier version was another function of the same scene.
    """
    try:
        kept = scene_digest(found.scene, [item.splat_digest for item in found.header.objects])
    except SceneError as error:
        raise RecordingError(f"{found.path}: its scene cannot be compared with this one, {error}: {_ADVICE}") from None
    if kept != wanted.scene_digest:
        raise RecordingError(
            f"{found.path}: the scene, or a file that it names, has changed since it was recorded: {_ADVICE}"
        )
    if found.forgotten:
        raise RecordingError(
            f"{found.path}: its scene has keys that this GASP does not know any more, and that may decide the frames"
            f" ({', '.join(found.forgotten)}): {_ADVICE}"
        )


def _changes(found: EngineRecord, wanted: EngineRecord, descriptor: EngineDescriptor, options: Any) -> list[str]:
    """What of the engine is not what it was, one phrase each."""
    changed = [
        f"{field.name} {getattr(found, field.name)} -> {getattr(wanted, field.name)}"
        for field in dataclasses.fields(EngineRecord)
        if field.name != "options" and getattr(found, field.name) != getattr(wanted, field.name)
    ]
    if dict(found.options) != dict(wanted.options) and not _same_options(found, descriptor, options):
        changed.append(f"options {_told(found)} -> {_told(wanted)}")
    return changed


def _same_options(found: EngineRecord, descriptor: EngineDescriptor, options: Any) -> bool:
    """Whether the options that were kept are these, an option that is new since then being at its default."""
    try:
        kept = build_options(descriptor, found.options)
    except SceneError:
        return False
    return chosen_options(kept) == chosen_options(options)


def _told(record: EngineRecord) -> str:
    told = ", ".join(f"{name} = {repr(value)[:_LONGEST]}" for name, value in sorted(record.options.items()))
    return f"({told})" if told else "(defaults)"
