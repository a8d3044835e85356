import pytest
from gasp_viewer.playback import Film, Playhead, advanced, pressed, sought

FILM = Film(count=10, frame_rate=25.0)


def test_a_film_at_rest_stays_where_it_is():
    head = Playhead(position=3.5)
    assert advanced(head, FILM, 100.0, speed=4.0, loop=True) == head


@pytest.mark.parametrize(
    ("seconds", "speed", "frame"), [(0.04, 1.0, 1), (0.08, 0.5, 1), (0.04, 4.0, 4), (0.039, 1.0, 0)]
)
def test_it_moves_by_the_frame_rate_times_the_speed(seconds, speed, frame):
    assert advanced(Playhead(playing=True), FILM, seconds, speed=speed, loop=False).frame == frame


def test_many_small_steps_are_one_large_one():
    head = Playhead(playing=True)
    for _ in range(1000):
        head = advanced(head, FILM, 0.3 / 1000, speed=1.0, loop=False)
    # A thousand roundings of numbers below 8.
    assert head.position == pytest.approx(7.5, abs=1000 * 8 * 2.0**-53)


def test_the_last_frame_is_shown_for_as_long_as_any():
    assert advanced(Playhead(position=9.0, playing=True), FILM, 0.039, speed=1.0, loop=False).frame == 9


def test_at_the_end_it_stops_at_the_last_frame():
    head = advanced(Playhead(position=9.5, playing=True), FILM, 1.0, speed=1.0, loop=False)
    assert head == Playhead(position=9.0, playing=False)


def test_or_begins_anew():
    head = advanced(Playhead(position=9.5, playing=True), FILM, 0.04, speed=1.0, loop=True)
    assert head.playing and head.position == pytest.approx(0.5)


def test_or_waits_for_the_frame_to_come():
    growing = Film(count=10, frame_rate=25.0, growing=True)
    head = advanced(Playhead(position=9.5, playing=True), growing, 1.0, speed=1.0, loop=False)
    assert head == Playhead(position=9.0, playing=True)
    longer = Film(count=12, frame_rate=25.0, growing=True)
    assert advanced(head, longer, 0.04, speed=1.0, loop=False).frame == 10


@pytest.mark.parametrize(("position", "frame"), [(-3.0, 0), (0.0, 0), (4.7, 4), (9.9, 9), (10.0, 9), (1e9, 9)])
def test_seeking_keeps_to_the_film(position, frame):
    assert sought(Playhead(playing=True), FILM, position).frame == frame
    assert sought(Playhead(playing=True), FILM, position).playing


def test_frames_that_are_taken_back_take_the_playhead_with_them():
    shorter = Film(count=4, frame_rate=25.0)
    assert advanced(Playhead(position=8.0), shorter, 0.0, speed=1.0, loop=False).frame == 3
    assert 0 <= advanced(Playhead(position=8.0, playing=True), shorter, 0.04, speed=1.0, loop=True).frame < 4


def test_the_button_plays_pauses_and_begins_anew_at_the_end():
    assert pressed(Playhead(position=2.0), FILM) == Playhead(position=2.0, playing=True)
    assert pressed(Playhead(position=2.0, playing=True), FILM) == Playhead(position=2.0)
    assert pressed(Playhead(position=9.0), FILM) == Playhead(playing=True)


def test_one_frame_is_no_film():
    single = Film(count=1, frame_rate=25.0)
    assert not pressed(Playhead(), single).playing
    assert advanced(Playhead(playing=True), single, 1.0, speed=1.0, loop=True) == Playhead(playing=False)
