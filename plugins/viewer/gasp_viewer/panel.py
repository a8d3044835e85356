"""The controls beside the picture, the same for every browser that looks.

The session reads the controls whenever it looks at the clock; a change here only wakes it.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from html import escape
from typing import Any

import viser

from gasp_viewer.colouring import BODY_COLOURS, STATIC, VIRIDIS, Scale

__all__ = ["Panel", "body_legend", "facts_table", "scale_legend"]

Triple = tuple[float, float, float]

_SPEEDS = (0.1, 4.0)
_NO_SHOTS = "Views that are kept at several frames become the path of a film's camera."


class Panel:
    """Timeline, choices, legend and facts.

    Parameters
    ----------
    server
        Whose page it is on.
    layers
        Names of the layers and how they are called on the page.
    colourings
        Names of the colourings.
    notes
        Sentences about the footage.
    is_film
        Whether there is anything to play.
    wake
        Called when a control was changed.
    keep
        Called with the camera of whoever keeps his view, or with None to begin anew; gives the text of what is kept.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        *,
        layers: dict[str, str],
        colourings: Sequence[str],
        notes: Sequence[str],
        is_film: bool,
        wake: Callable[[], None],
        keep: Callable[[viser.CameraHandle | None], str],
    ) -> None:
        gui = server.gui
        self._names = {title: name for name, title in layers.items()}
        self._colourings = tuple(colourings)
        self._pressed = threading.Event()
        self._shown_frame = 0
        self._message = gui.add_html("", visible=False)
        self._frame = gui.add_slider("Frame", min=0, max=1, step=1, initial_value=0, visible=is_film)
        self._play = gui.add_button("Play", icon=viser.Icon.PLAYER_PLAY, visible=is_film)
        self._speed = gui.add_slider(
            "Speed", min=_SPEEDS[0], max=_SPEEDS[1], step=0.1, initial_value=1.0, visible=is_film
        )
        self._loop = gui.add_checkbox("Loop", initial_value=True, visible=is_film)
        self._follow = gui.add_checkbox(
            "Follow", initial_value=False, visible=False, hint="Stay at the newest frame of a run that goes on"
        )
        self._layer = gui.add_dropdown("Show", tuple(layers.values()))
        self._colouring = gui.add_dropdown("Colour", tuple(colourings), visible=len(colourings) > 1)
        self._legend = gui.add_html("", visible=False)
        reset = gui.add_button("Reset view", icon=viser.Icon.HOME_MOVE)
        self._facts = gui.add_html("")
        with gui.add_folder("Camera of a film", expand_by_default=False):
            keeps = gui.add_button("Keep this view", icon=viser.Icon.CAMERA_PLUS)
            anew = gui.add_button("Begin anew")
            self._shots = gui.add_html(_block(_NO_SHOTS))
        if notes:
            with gui.add_folder("Notes", expand_by_default=False):
                gui.add_html(_block("".join(f"<p>{escape(note)}</p>" for note in notes)))

        def change(_: Any) -> None:
            wake()

        def press(_: Any) -> None:
            self.press_play()
            wake()

        self._play.on_click(press)
        self.controls: dict[str, Any] = {
            "frame": self._frame,
            "speed": self._speed,
            "loop": self._loop,
            "follow": self._follow,
            "layer": self._layer,
            "colouring": self._colouring,
        }
        """What the user sets, by name."""
        self.texts = {"message": self._message, "legend": self._legend, "facts": self._facts, "camera": self._shots}
        """What the user reads, by name."""
        for control in self.controls.values():
            control.on_update(change)
        reset.on_click(self._reset)

        def keep_view(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            if event.client is not None:
                self.set_shots(keep(event.client.camera))

        keeps.on_click(keep_view)
        anew.on_click(lambda _: self.set_shots(keep(None)))
        self._eye: Triple = (1.0, 1.0, 1.0)
        self._target: Triple = (0.0, 0.0, 0.0)

    def choose(self, layer: str, colouring: str) -> None:
        """Set what is shown."""
        self._layer.value = next(title for title, name in self._names.items() if name == layer)
        self._colouring.value = colouring

    @property
    def layer(self) -> str:
        """Name of the layer that is asked for."""
        # A page may send anything.
        return self._names.get(self._layer.value, next(iter(self._names.values())))

    @property
    def colouring(self) -> str:
        """Name of the colouring that is asked for."""
        asked = self._colouring.value
        return asked if asked in self._colourings else self._colourings[0]

    @property
    def speed(self) -> float:
        """How many times as fast as it was."""
        asked = self._speed.value
        return asked if _SPEEDS[0] <= asked <= _SPEEDS[1] else 1.0

    @property
    def loop(self) -> bool:
        """Whether the film begins anew at its end."""
        return self._loop.value

    @property
    def follow(self) -> bool:
        """Whether to stay at the newest frame."""
        return self._follow.visible and self._follow.value

    def set_follow(self, follow: bool) -> None:
        """Tick or clear the box."""
        self._follow.value = follow

    def press_play(self) -> None:
        """What the button does."""
        self._pressed.set()

    def take_press(self) -> bool:
        """Whether play was pressed since this was asked last."""
        pressed = self._pressed.is_set()
        self._pressed.clear()
        return pressed

    def take_seek(self) -> int | None:
        """The frame the timeline was moved to since it was last set; None: it was not."""
        frame = self._frame.value
        return None if frame == self._shown_frame else frame

    def set_frame(self, frame: int) -> None:
        """Move the timeline."""
        self._shown_frame = frame
        self._frame.value = frame

    def set_film(self, count: int, growing: bool) -> None:
        """Say how long the timeline is, and whether it may still grow."""
        # viser wants a range even where there is one frame.
        last = max(count - 1, 1)
        if self._frame.max != last:
            self._frame.max = last
        if self._follow.visible != growing:
            self._follow.visible = growing

    def set_playing(self, playing: bool) -> None:
        """What the button offers."""
        label = "Pause" if playing else "Play"
        if self._play.label != label:
            self._play.label = label
            self._play.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY

    def set_legend(self, html: str) -> None:
        """Explain the colours; nothing where there is nothing to explain."""
        _fill(self._legend, html)

    def set_facts(self, facts: Sequence[tuple[str, str]]) -> None:
        """Show names and values."""
        _fill(self._facts, facts_table(facts))

    def set_message(self, message: str) -> None:
        """Show what is wrong; nothing where nothing is."""
        style = "background:#fff4e5;color:#663c00;border-left:4px solid #ed6c02;padding:.5em .7em"
        _fill(self._message, _block(f'<div role="alert" style="{style}">{escape(message)}</div>') if message else "")

    def set_shots(self, text: str) -> None:
        """Show the camera that has been kept, to be copied."""
        style = "white-space:pre-wrap;user-select:all;margin:0;font-size:.7rem"
        hint = "<p>For the scene file; or as camera.toml for gasp render --camera camera.toml</p>"
        _fill(self._shots, _block(f'<pre style="{style}">{escape(text)}</pre>{hint}' if text else _NO_SHOTS))

    def set_view(self, eye: Triple, target: Triple) -> None:
        """Where "Reset view" brings the camera back to, on the stage."""
        self._eye, self._target = eye, target

    def _reset(self, event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        if event.client is None:
            return
        camera = event.client.camera
        with event.client.atomic():
            camera.up_direction = (0.0, 0.0, 1.0)
            camera.position = self._eye
            camera.look_at = self._target


def scale_legend(scale: Scale) -> str:
    """A bar of the colour map with its range."""
    colours = ", ".join(_css(colour) for colour in VIRIDIS)
    # From the top on, everything has the last colour.
    return _block(
        f'<div style="display:flex;justify-content:space-between"><span>0 {escape(scale.unit)}</span>'
        f"<span>{escape(scale.name)}</span><span>&ge; {scale.top:g} {escape(scale.unit)}</span></div>"
        f'<div style="height:.8em;border-radius:2px;background:linear-gradient(to right, {colours})"></div>'
    )


def body_legend(names: Sequence[str], has_static: bool) -> str:
    """A swatch and a name for every body."""
    entries = [(name, BODY_COLOURS[index % len(BODY_COLOURS)]) for index, name in enumerate(names)]
    if has_static:
        entries.append(("not simulated", STATIC))
    swatch = "display:inline-block;width:.8em;height:.8em;border-radius:2px;margin-right:.4em;background:"
    return _block(
        "".join(f'<div><span style="{swatch}{_css(colour)}"></span>{escape(name)}</div>' for name, colour in entries)
    )


def facts_table(facts: Sequence[tuple[str, str]]) -> str:
    """Names and values as a table."""
    name, value = "padding:.1em .8em .1em 0;opacity:.7;vertical-align:top;white-space:nowrap", "padding:.1em 0"
    rows = "".join(
        f'<tr><td style="{name}">{escape(key)}</td><td style="{value}">{escape(text)}</td></tr>' for key, text in facts
    )
    return _block(f'<table style="border-collapse:collapse;font-variant-numeric:tabular-nums">{rows}</table>')


def _fill(handle: viser.GuiHtmlHandle, html: str) -> None:
    if handle.content != html:
        handle.content = html
    if handle.visible != bool(html):
        handle.visible = bool(html)


def _block(html: str) -> str:
    return f'<div style="padding:0 .8em .6em;font-size:.8rem;line-height:1.4;overflow-wrap:anywhere">{html}</div>'


def _css(colour: Any) -> str:
    red, green, blue = (round(255 * float(channel)) for channel in colour)
    return f"rgb({red}, {green}, {blue})"
