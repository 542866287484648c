"""The game, one step, as a recipe: for one table, and for the rows of a batch."""

from __future__ import annotations

from airhockey_env.compiled import compiled, inlined
from airhockey_env.engine.advance import advance
from airhockey_env.engine.motion import glide
from airhockey_env.engine.records import Discs
from airhockey_env.engine.tolerances import GAME_CONTACTS
from airhockey_env.kernel.observations import observe
from airhockey_env.kernel.paddles import drive
from airhockey_env.kernel.parameters import draw_physics
from airhockey_env.kernel.rewards import keep_potentials, shaping
from airhockey_env.kernel.rules import judge, play_on
from airhockey_env.kernel.scripted import EXTERNAL, play
from airhockey_env.kernel.state import AUTORESET_NEXT_STEP, AUTORESET_SAME_STEP, LEFT, PUCK, RIGHT
from airhockey_env.kernel.tasks import end_task, start_task


@inlined
def play_tick(table, physics, contacts):
    """Paddles have their velocities: let the engine play one tick. Returns the side of the goal that was hit, or 0."""
    discs = Discs(table.position, table.velocity, physics.radius, physics.inverse_mass, table.hits)
    for disc in range(3):
        table.hits[disc] = 0
    p, q, r, s = physics.glide_p, physics.glide_q, physics.glide_r, physics.glide_s
    glide(discs, PUCK, p, q, r, s, physics.puck_speed)
    outcome = advance(discs, physics, 0.0, physics.tick, GAME_CONTACTS, contacts, False, None)
    glide(discs, PUCK, p, q, r, s, physics.puck_speed)
    table.n_contacts = min(outcome.contacts, contacts.shape[0])
    return outcome.goal


@inlined
def begin(table, physics, settings, ranges, side):
    """Start the table's next episode; where the task begins with a serve, by `side` (0: drawn at random)."""
    table.steps = 0
    table.score[0] = 0
    table.score[1] = 0
    table.n_contacts = 0
    table.success = 0
    table.done = False
    for player in (LEFT, RIGHT):
        table.wander[player, 0] = 0.0
        table.wander[player, 1] = 0.0
    if settings.randomized:
        draw_physics(table, physics, ranges)
    start_task(table, physics, settings.task, side)
    keep_potentials(table, physics, settings)


@inlined
def step_table(table, physics, settings, ax, ay, bx, by, contacts):
    """Play one step of one table; (ax, ay) and (bx, by) are the left and the right player's actions.

    Returns (point, foul, reward of the left player, that of the right player, terminated, truncated).
    """
    drive(table, physics, LEFT, ax, ay)
    drive(table, physics, RIGHT, bx, by)
    goal = play_tick(table, physics, contacts)
    point, foul = judge(table, physics, goal)
    terminated, success = end_task(table, settings, point, foul)
    if not terminated:
        play_on(table, physics, point, foul)
    reward, other_reward = float(point), float(-point)
    if settings.shaped:
        reward += shaping(table, physics, LEFT, terminated)
        if settings.both_sides:
            other_reward += shaping(table, physics, RIGHT, terminated)
    table.steps += 1
    truncated = settings.max_steps > 0 and table.steps >= settings.max_steps and not terminated
    table.success = 1 if terminated and success else 0
    table.done = terminated or truncated
    return point, foul, reward, other_reward, terminated, truncated


@inlined
def choose(table, physics, player, actions, i):
    """A player's action: the caller's, or what the scripted player does who drives that paddle."""
    if table.player[player] == EXTERNAL:
        return float(actions[i, 0]), float(actions[i, 1])
    return play(table, physics, player)


@compiled
def step_rows(first, last, tables, physics, settings, ranges, actions, others, out):
    """Play one step of the tables `first` to `last` (excluded).

    Args:
        tables: (N,) `TABLE`; changed in place.
        physics: (1,) or (N,) `PHYSICS`.
        settings: (1,) `SETTINGS`.
        ranges: of the physics, where the settings say that they are randomized; see `draw_physics`.
        actions, others: (N, 2) float32 of the left and the right players; read where these are EXTERNAL.
        out: `Outputs`; written in place.
    """
    rules = settings[0]
    own_physics = physics.shape[0] > 1
    for i in range(first, last):
        table = tables[i]
        law = physics[i if own_physics else 0]
        if table.done and rules.autoreset == AUTORESET_NEXT_STEP:
            begin(table, law, rules, ranges, 0)
            forget_step(out, i)
            out.reward[i] = 0.0
            out.terminated[i] = False
            out.truncated[i] = False
            if rules.both_sides:
                out.other_reward[i] = 0.0
        else:
            ax, ay = choose(table, law, LEFT, actions, i)
            bx, by = choose(table, law, RIGHT, others, i)
            result = step_table(table, law, rules, ax, ay, bx, by, out.contacts[i])
            point, foul, reward, other_reward, terminated, truncated = result
            out.n_contacts[i] = table.n_contacts
            out.point[i] = point
            out.foul[i] = foul
            out.reward[i] = reward
            if rules.both_sides:
                out.other_reward[i] = other_reward
            out.terminated[i] = terminated
            out.truncated[i] = truncated
            out.success[i] = table.success != 0
            if table.done and rules.autoreset == AUTORESET_SAME_STEP:
                observe(table, law, LEFT, out.final_observation, i)
                out.final_score[i, 0], out.final_score[i, 1] = table.score[0], table.score[1]
                if rules.randomized:
                    out.final_spec[i, :] = law.spec
                begin(table, law, rules, ranges, 0)
        observe_row(table, law, rules, out, i)


@inlined
def observe_row(table, physics, settings, out, i):
    """Write what table i looks like: its observations and its score."""
    observe(table, physics, LEFT, out.observation, i)
    out.score[i, 0], out.score[i, 1] = table.score[0], table.score[1]
    if settings.both_sides:
        observe(table, physics, RIGHT, out.other_observation, i)


@compiled
def reset_rows(rows, sides, tables, physics, settings, ranges, out):
    """Begin an episode on each of the given tables, with a serve by `sides[k]` (0: drawn at random)."""
    own_physics = physics.shape[0] > 1
    for k in range(rows.shape[0]):
        i = rows[k]
        law = physics[i if own_physics else 0]
        begin(tables[i], law, settings[0], ranges, sides[k])
        forget_step(out, i)
        observe_row(tables[i], law, settings[0], out, i)


@inlined
def forget_step(out, i):
    """Nothing has happened on table i since its episode began, or since its state was set."""
    out.n_contacts[i] = 0
    out.point[i] = 0
    out.foul[i] = False
    out.success[i] = False


@compiled
def refresh_rows(rows, tables, physics, settings, out):
    """Bring everything that is derived from the given tables up to date after they were changed from outside."""
    own_physics = physics.shape[0] > 1
    for k in range(rows.shape[0]):
        i = rows[k]
        law = physics[i if own_physics else 0]
        if not tables[i].done:
            keep_potentials(tables[i], law, settings[0])
        observe_row(tables[i], law, settings[0], out, i)
