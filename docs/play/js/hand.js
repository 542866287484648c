/** How a paddle follows a target within its limits: airhockey_env/live/hand.py in JavaScript. */

/** The greatest speed for the coming tick from which one can still stop within `distance`. */
function approachSpeed(distance, step, tick) {
  const ticks = Math.ceil(0.5 * (Math.sqrt(1 + (8 * distance) / (tick * step)) - 1) - 1e-9);
  return ticks < 1 ? 0 : (distance / tick + 0.5 * step * ticks * (ticks - 1)) / ticks;
}

export class Hand {
  /**
   * @param {object} table - of game.json.
   * @param {number} tick - s.
   */
  constructor({ dimensions, paddle_speed: speed, paddle_step: step }, tick) {
    const { length, width, paddle_radius: radius } = dimensions;
    this.speed = speed;
    this.step = step;
    this.tick = tick;
    this.near = [radius - 0.5 * length, radius - 0.5 * width];
    this.far = [-radius, 0.5 * width - radius];
  }

  /** The place nearest to the given one at which the paddle can be. */
  reachable(place) {
    return place.map((p, axis) => Math.min(Math.max(p, this.near[axis]), this.far[axis]));
  }

  /**
   * The action that brings the paddle to a target as fast as its limits allow, and stops it there.
   *
   * @param {number[]} place, velocity - of the paddle, m and m/s.
   * @param {number[]} target - where the target will be at the end of the tick, m.
   * @param {number[]} targetVelocity - m/s: the paddle brakes down to this one, so that it keeps up with the target.
   */
  follow(place, velocity, target, targetVelocity) {
    const [ux, uy] = targetVelocity;
    let dx = target[0] - ux * this.tick - place[0];
    let dy = target[1] - uy * this.tick - place[1];
    const distance = Math.hypot(dx, dy);
    if (distance > 0) {
      [dx, dy] = [dx / distance, dy / distance];
    }
    // What turns the paddle's way towards the target is not there for braking.
    const across = Math.min(Math.abs(dx * (velocity[1] - uy) - dy * (velocity[0] - ux)), 0.8 * this.step);
    const wanted = approachSpeed(distance, Math.sqrt(this.step * this.step - across * across), this.tick);
    const [vx, vy] = [ux + wanted * dx, uy + wanted * dy];
    const share = 1 / Math.max(this.speed, Math.hypot(vx, vy));
    return [vx * share, vy * share];
  }
}
