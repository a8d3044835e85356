// The page: a time line, a camera that goes around, and what happens in between.

import { Motion } from "./decoder.js";
import { Ground } from "./ground.js";
import { Painter } from "./painter.js";
import { openSplat } from "./splat.js";

const canvas = document.querySelector("canvas");
const line = document.querySelector("#time");
const button = document.querySelector("#play");
const told = document.querySelector("#told");

/** A camera that looks at a target from a distance, z up. */
class Orbit {
  constructor(camera, motion) {
    const middle = [0, 1, 2].map((i) => {
      let sum = 0;
      for (let row = 0; row < motion.means.length; row += 3) sum += motion.means[row + i];
      return (3 * sum) / motion.means.length;
    });
    const { position, target, vertical_angle } = camera ?? {
      position: [middle[0] + 1, middle[1] - 2, middle[2] + 1], target: middle, vertical_angle: 40,
    };
    const toward = position.map((value, i) => value - target[i]);
    this.target = [...target];
    this.distance = Math.hypot(...toward);
    this.around = Math.atan2(toward[1], toward[0]);
    this.above = Math.asin(toward[2] / this.distance);
    this.angle = (vertical_angle * Math.PI) / 180;
  }

  frame(width, height) {
    const [ca, sa, cb, sb] = [Math.cos(this.around), Math.sin(this.around), Math.cos(this.above), Math.sin(this.above)];
    const toward = [cb * ca, cb * sa, sb];
    const eye = this.target.map((value, i) => value + this.distance * toward[i]);
    const right = [-sa, ca, 0];
    const down = [sb * ca, sb * sa, -cb];
    const away = toward.map((value) => -value);
    const rows = [right, down, away];
    const view = new Float32Array(16);
    rows.forEach((row, i) => {
      for (let j = 0; j < 3; j++) view[4 * j + i] = row[j];
      view[12 + i] = -(row[0] * eye[0] + row[1] * eye[1] + row[2] * eye[2]);
    });
    view[15] = 1;
    return { view, eye, focal: height / 2 / Math.tan(this.angle / 2), width, height };
  }
}

function bytesOf(text) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let index = 0; index < bytes.length; index++) bytes[index] = characters.charCodeAt(index);
  return bytes;
}

async function main() {
  const gl = canvas.getContext("webgl2", { alpha: true, premultipliedAlpha: true, antialias: false, preserveDrawingBuffer: true });
  if (!gl) throw new Error("this browser has no WebGL 2");
  const holder = document.querySelector("#splat");
  const splat = await openSplat(gl, bytesOf(holder.textContent.trim()));
  holder.remove();
  const motion = await Motion.of(splat.files, splat.means, splat.axes, splat.scales);
  const { frames, frame_rate, camera } = motion.header;
  const ground = await Ground.of(gl, motion.header, splat.files);
  const painter = new Painter(gl, splat, ground, motion);
  const orbit = new Orbit(camera, motion);
  const state = { frame: 0, playing: true, changed: true, shown: -1, painted: 0, since: performance.now() };
  line.max = frames - 1;

  const size = () => {
    const scale = Math.min(window.devicePixelRatio, 2);
    const [width, height] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height, state.changed] = [width, height, true];
  };
  const seek = (frame) => {
    state.frame = ((frame % frames) + frames) % frames;
    state.since = performance.now() - (1000 * state.frame) / frame_rate;
    state.changed = true;
  };
  const play = (playing) => {
    state.playing = playing;
    button.textContent = playing ? "❚❚" : "►";
    button.title = playing ? "Stop" : "Play";
    seek(state.frame);
  };
  const draw = async () => {
    size();
    if (state.playing) {
      const frame = Math.floor(((performance.now() - state.since) * frame_rate) / 1000);
      if (frame >= frames) seek(0);
      else state.frame = frame;
    }
    if (state.frame !== state.shown) {
      const frame = state.frame;
      await motion.show(frame);
      painter.take(motion);
      ground.show(frame);
      state.shown = frame;
      state.changed = true;
      line.value = frame;
      told.textContent = `${(frame / frame_rate).toFixed(2)} s`;
    }
    if (state.changed) {
      state.changed = false;
      painter.paint(orbit.frame(canvas.width, canvas.height));
      state.painted++;
    }
  };
  const loop = async () => {
    try {
      await draw();
      requestAnimationFrame(loop);
    } catch (error) {
      fail(error);
    }
  };

  button.addEventListener("click", () => play(!state.playing));
  line.addEventListener("input", () => {
    play(false);
    seek(Number(line.value));
  });
  canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", (event) => {
    if (!event.buttons) return;
    if (event.buttons === 1 && !event.shiftKey) {
      orbit.around -= event.movementX * 0.008;
      orbit.above = Math.max(-1.55, Math.min(1.55, orbit.above + event.movementY * 0.008));
    } else {
      const { view } = orbit.frame(1, 1);
      const step = (orbit.distance * 2 * Math.tan(orbit.angle / 2)) / canvas.clientHeight;
      for (let i = 0; i < 3; i++) orbit.target[i] -= step * (view[4 * i] * event.movementX + view[4 * i + 1] * event.movementY);
    }
    state.changed = true;
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    orbit.distance *= Math.exp(event.deltaY * 0.001);
    state.changed = true;
  }, { passive: false });
  window.addEventListener("keydown", (event) => {
    if (event.key === " ") play(!state.playing);
    if (event.key === "ArrowRight") play(false), seek(state.frame + 1);
    if (event.key === "ArrowLeft") play(false), seek(state.frame - 1);
  });
  window.addEventListener("resize", () => (state.changed = true));

  // For whoever drives the page from outside.
  window.gasp = { state, play, seek, motion, painter, orbit };
  play(true);
  await loop();
}

function fail(error) {
  told.textContent = error.message;
  document.body.classList.add("failed");
  throw error;
}

main().catch(fail);
