/**
 * The shot clock: a bar that grows from the middle towards the side that the puck is on, and is full at the foul.
 */
import { css } from "./table.js";

/**
 * @param {HTMLCanvasElement} canvas
 * @param {number} used - share of the clock, negative while the puck is on the left.
 * @param {Object<string, number[]>} palette
 */
export function drawShotClock(canvas, used, palette) {
  const context = canvas.getContext("2d");
  const { width, height } = canvas;
  context.clearRect(0, 0, width, height);
  const share = Math.abs(used);
  context.fillStyle = css(share > 0.75 ? palette.clock_late : share > 0.5 ? palette.clock_soon : palette.marking);
  const middle = 0.5 * width;
  context.fillRect(used < 0 ? middle * (1 - share) : middle, 0, middle * share, height);
}
