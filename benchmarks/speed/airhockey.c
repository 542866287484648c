/* The default game, AirHockey-v0, in C, as a baseline for the compiled batch step.
 *
 * One point against the striker at full skill, with the same table for all environments, state observations, the sparse
 * reward and automatic resets. This is the same game as airhockey_env/kernel/step.py with its defaults, and it gives the
 * same bits, because every expression is evaluated in the same order. Compile it without contraction and fast-math, as
 * benchmarks/speed/build.py does. There are no tasks, other opponents or randomized tables. The modules of the package
 * explain why things are as they are.
 */

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

enum { LEFT, RIGHT, PUCK };
enum { NEXT_STEP = 1, SAME_STEP = 2 };
enum { CONTACT_ROWS = 8, CONTACT_LIMIT = 8, OBSERVATION_SIZE = 13, POINTS = 1 };

static const double HOME = 0.8, SERVE_NEAR = 0.2, SERVE_FAR = 0.5, SERVE_WIDE = 0.5;
static const double GUARD = 0.72, BRAKING = 0.5;
static const double TOUCH_SPEED = 1e-12, TOUCH_GAP = 1e-14;

typedef struct { double x, y; } Vector;

/* Fields of PARAMETERS (airhockey_env/kernel/state.py), in its order. */
typedef struct {
    double tick;
    int64_t clock_limit;
    double half_length, half_width, half_goal;
    double wall_restitution, wall_tangential, disc_restitution;
    double radius[3], inverse_mass[3];
    double glide_p, glide_q, glide_r, glide_s;
    double puck_speed, paddle_speed, paddle_step;
    double per_x, per_y, per_paddle, per_puck, per_clock;
} Parameters;

/* The fields of STATE that this game needs. */
typedef struct {
    Vector position[3], velocity[3];
    double plan;
    uint64_t stream;
    int32_t steps, clock, score[2], side, done;
} State;

typedef struct {
    double time;
    int32_t a, b;
    double x, y, nx, ny, impulse;
} Contact;

typedef struct {
    float *observation, *final_observation;
    int32_t *score, *final_score, *n_contacts;
    int8_t *point;
    bool *foul, *success;
    double *reward, *right_reward;
    bool *terminated, *truncated, *began;
    Contact *contacts;
} Outputs;

static inline double least(double a, double b) { return b < a ? b : a; }
static inline double greatest(double a, double b) { return b > a ? b : a; }
static inline double clamp(double value, double limit) { return least(greatest(value, -limit), limit); }

/* Random numbers: SplitMix64 ---------------------------------------------------------------------------------- */

static inline double draw(State *state)
{
    uint64_t z = state->stream += 0x9E3779B97F4A7C15u;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    z ^= z >> 31;
    return (double)(z >> 11) * (1.0 / 9007199254740992.0);
}

static inline double draw_between(State *state, double low, double high) { return low + (high - low) * draw(state); }

/* The striker --------------------------------------------------------------------------------------------------- */

/* The table as the right player sees it, turned by 180 degrees. */
typedef struct { Vector own, other, puck, puck_velocity; } View;

static inline Vector towards(const View *seen, const Parameters *params, double x, double y)
{
    double dx = x - seen->own.x, dy = y - seen->own.y;
    double distance = sqrt(dx * dx + dy * dy);
    double braking = sqrt(BRAKING * params->paddle_step / params->tick * distance);
    double speed = least(least(braking, distance / params->tick), params->paddle_speed);
    double share = speed / (params->paddle_speed * greatest(distance, 1e-9));
    return (Vector){dx * share, dy * share};
}

static inline double folded(double y, double limit)
{
    if (y > limit)
        y = 2.0 * limit - y;
    else if (y < -limit)
        y = -2.0 * limit - y;
    return clamp(y, limit);
}

static inline Vector defend(const View *seen, const Parameters *params)
{
    double guard = -GUARD * params->half_length;
    Vector puck = seen->puck, velocity = seen->puck_velocity;
    if (puck.x < seen->own.x && fabs(puck.y) > params->half_goal)
        return towards(seen, params, guard, clamp(puck.y, 0.5 * params->half_goal));
    double y = 0.5 * puck.y;
    if (velocity.x < -0.3 && puck.x > guard) {
        y = puck.y + velocity.y * (guard - puck.x) / velocity.x;
        if (velocity.x > -0.4 * params->paddle_speed)
            y = folded(y, params->half_width - params->radius[PUCK]);
    }
    return towards(seen, params, guard, clamp(y, 1.6 * params->half_goal));
}

static inline Vector aim(const View *seen, const Parameters *params, double x, double y, double plan)
{
    double wall = params->half_width - params->radius[PUCK];
    double spread = 0.7 * (params->half_goal - params->radius[PUCK]);
    double goal_y;
    if (plan < 0.4) {
        goal_y = seen->other.y < 0.0 ? spread : -spread;
    } else {
        double side = plan < 0.7 ? 1.0 : -1.0;
        double part = plan < 0.7 ? (plan - 0.4) / 0.3 : (plan - 0.7) / 0.3;
        double bend = params->wall_tangential / greatest(params->wall_restitution, 0.1);
        goal_y = side * (wall + bend * (wall + part * spread));
    }
    double dx = params->half_length - x, dy = goal_y - y;
    double length = sqrt(dx * dx + dy * dy);
    return (Vector){dx / length, dy / length};
}

static inline Vector striker(const View *seen, const Parameters *params, double plan)
{
    Vector own = seen->own, puck = seen->puck, velocity = seen->puck_velocity;
    double reach = params->radius[LEFT] + params->radius[PUCK];
    double far_x = params->half_length - params->radius[LEFT], far_y = params->half_width - params->radius[LEFT];
    double speed = sqrt(velocity.x * velocity.x + velocity.y * velocity.y);
    if (puck.x > 0.0 || velocity.x > 0.3 * params->paddle_speed || speed > 0.75 * params->paddle_speed)
        return defend(seen, params);

    double gap_x = puck.x - own.x, gap_y = puck.y - own.y;
    double gap = sqrt(gap_x * gap_x + gap_y * gap_y);
    double lead = greatest(0.0, gap - reach) / params->paddle_speed;
    double x = greatest(puck.x + velocity.x * lead, params->radius[PUCK] - params->half_length);
    double y = folded(puck.y + velocity.y * lead, params->half_width - params->radius[PUCK]);

    Vector course = aim(seen, params, x, y, plan);
    double shot = 0.8 * (1.0 + params->disc_restitution) * params->paddle_speed;
    double nx = shot * course.x - velocity.x, ny = shot * course.y - velocity.y;
    double length = sqrt(nx * nx + ny * ny);
    nx = nx / length;
    ny = ny / length;
    double kiss_x = x - reach * nx - own.x, kiss_y = y - reach * ny - own.y;
    double distance = sqrt(kiss_x * kiss_x + kiss_y * kiss_y);
    double to_x = x - own.x, to_y = y - own.y;
    if (to_x > 0.0 && kiss_x * nx + kiss_y * ny > 0.7 * distance && 0.7 * distance > 0.0)
        return (Vector){kiss_x / distance, kiss_y / distance};

    double behind_x = greatest(x - 2.2 * reach * nx, -far_x), behind_y = clamp(y - 2.2 * reach * ny, far_y);
    if (to_x < 0.9 * reach && fabs(to_y) < 1.2 * reach) {
        double side = to_y < 0.0 ? 1.0 : -1.0;
        if (fabs(y + side * 1.3 * reach) > far_y)
            side = -side;
        behind_y = y + side * 1.5 * reach;
        if (to_x < -0.9 * reach || fabs(to_y) < reach)
            behind_x = own.x;
    }
    return towards(seen, params, behind_x, behind_y);
}

/* The striker on the right, which uses the share `skill` of its paddle's speed. */
static inline Vector opponent(const State *state, const Parameters *params, double skill)
{
    const Vector *p = state->position;
    Vector v = state->velocity[PUCK];
    View seen = {{-p[RIGHT].x, -p[RIGHT].y}, {-p[LEFT].x, -p[LEFT].y}, {-p[PUCK].x, -p[PUCK].y}, {-v.x, -v.y}};
    Vector action = striker(&seen, params, state->plan);
    double share = skill / greatest(sqrt(action.x * action.x + action.y * action.y), 1.0);
    return (Vector){action.x * share, action.y * share};
}

/* Paddles ------------------------------------------------------------------------------------------------------- */

static inline double within(double place, double velocity, double low, double high, double tick)
{
    double after = place + velocity * tick;
    if (after > high)
        return (high - place) / tick;
    if (after < low)
        return (low - place) / tick;
    return velocity;
}

static inline void drive(State *state, const Parameters *params, int player, Vector action)
{
    double forward = player == LEFT ? 1.0 : -1.0;
    double ax = least(greatest(action.x, -1.0), 1.0), ay = least(greatest(action.y, -1.0), 1.0);
    double length2 = ax * ax + ay * ay;
    double scale = forward * params->paddle_speed;
    if (length2 > 1.0)
        scale /= sqrt(length2);
    Vector *position = &state->position[player], *velocity = &state->velocity[player];
    double dvx = ax * scale - velocity->x, dvy = ay * scale - velocity->y;
    double change2 = dvx * dvx + dvy * dvy;
    if (change2 > params->paddle_step * params->paddle_step) {
        double share = params->paddle_step / sqrt(change2);
        dvx *= share;
        dvy *= share;
    }
    double near = params->radius[player], far = params->half_length - params->radius[player];
    double low = player == LEFT ? -far : near, high = player == LEFT ? -near : far;
    double side = params->half_width - params->radius[player];
    velocity->x = within(position->x, velocity->x + dvx, low, high, params->tick);
    velocity->y = within(position->y, velocity->y + dvy, -side, side, params->tick);
}

/* The engine ---------------------------------------------------------------------------------------------------- */

typedef enum { NOTHING, DISC, WALL, POST, GOAL } Kind;

/* The next kiss of the puck: with paddle `which`, with the wall at +x, -x, +y or -y, with a post, with a goal line. */
typedef struct {
    double time;
    Kind kind;
    int which;
} Kiss;

static inline double kiss_time(double dx, double dy, double vx, double vy, double reach)
{
    double approach = dx * vx + dy * vy;
    if (!(approach < 0.0))
        return INFINITY;
    double speed2 = vx * vx + vy * vy;
    double shared_leg = dx * vy - dy * vx;
    double top_leg2 = reach * reach * speed2 - shared_leg * shared_leg;
    if (!(top_leg2 > 0.0))
        return INFINITY;
    double distance2 = dx * dx + dy * dy, reach2 = reach * reach;
    if (distance2 <= reach2 * (1.0 + TOUCH_GAP)) {
        if (approach >= -TOUCH_SPEED * reach)
            return INFINITY;
        if (distance2 <= reach2)
            return 0.0;
    }
    return greatest(0.0, (-approach - sqrt(top_leg2)) / speed2);
}

static inline double approach_of(const State *state, int paddle)
{
    const Vector *p = state->position, *v = state->velocity;
    return (p[paddle].x - p[PUCK].x) * (v[paddle].x - v[PUCK].x)
         + (p[paddle].y - p[PUCK].y) * (v[paddle].y - v[PUCK].y);
}

static Kiss earlier_edge(Vector p, Vector v, const Parameters *params, Kiss best)
{
    double radius = params->radius[PUCK];
    double end = v.x > 0.0 ? 1.0 : -1.0;
    double limit = params->half_length - radius;
    if (end * (p.x + v.x * best.time) > limit && v.x != 0.0) {
        double time = greatest(0.0, (limit - end * p.x) / (end * v.x));
        if (time < best.time && fabs(p.y + v.y * time) >= params->half_goal)
            best = (Kiss){time, WALL, end > 0.0 ? 0 : 1};
    }
    double side = v.y > 0.0 ? 1.0 : -1.0;
    limit = params->half_width - radius;
    if (side * (p.y + v.y * best.time) > limit && v.y != 0.0) {
        double time = greatest(0.0, (limit - side * p.y) / (side * v.y));
        if (time < best.time)
            best = (Kiss){time, WALL, side > 0.0 ? 2 : 3};
    }
    for (int number = 0; number < 2; number++) {
        end = number == 0 ? 1.0 : -1.0;
        if (greatest(end * p.x, end * (p.x + v.x * best.time)) <= params->half_length - radius)
            continue;
        for (int post = 0; post < 2; post++) {
            side = post == 0 ? 1.0 : -1.0;
            double time = kiss_time(p.x - end * params->half_length, p.y - side * params->half_goal, v.x, v.y, radius);
            if (time < best.time)
                best = (Kiss){time, POST, 2 * number + post};
        }
        if (end * v.x > 0.0) {
            double time = greatest(0.0, (params->half_length - end * p.x) / (end * v.x));
            if (time < best.time)
                best = (Kiss){time, GOAL, number};
        }
    }
    return best;
}

static inline Kiss next_kiss(const State *state, const Parameters *params, double horizon)
{
    const Vector *p = state->position, *v = state->velocity;
    Kiss best = {horizon, NOTHING, -1};
    for (int a = LEFT; a <= RIGHT; a++) {
        double time = kiss_time(p[a].x - p[PUCK].x, p[a].y - p[PUCK].y, v[a].x - v[PUCK].x, v[a].y - v[PUCK].y,
                                params->radius[a] + params->radius[PUCK]);
        if (time < best.time
            || (time == best.time && best.kind == DISC && approach_of(state, a) < approach_of(state, best.which)))
            best = (Kiss){time, DISC, a};
    }
    double reach_x = params->half_length - params->radius[PUCK], reach_y = params->half_width - params->radius[PUCK];
    if (fabs(p[PUCK].x) > reach_x || fabs(p[PUCK].x + v[PUCK].x * best.time) > reach_x || fabs(p[PUCK].y) > reach_y
        || fabs(p[PUCK].y + v[PUCK].y * best.time) > reach_y)
        best = earlier_edge(p[PUCK], v[PUCK], params, best);
    return best;
}

static int strike_disc(State *state, const Parameters *params, int a, Contact *contacts, int count, double time)
{
    Vector *p = state->position, *v = state->velocity;
    double dx = p[a].x - p[PUCK].x, dy = p[a].y - p[PUCK].y;
    double distance = sqrt(dx * dx + dy * dy);
    double vx = v[a].x - v[PUCK].x, vy = v[a].y - v[PUCK].y;
    double approach = dx * vx + dy * vy;
    if (!(approach < 0.0))
        return count;
    double nx = dx / distance, ny = dy / distance;
    double impulse = -(1.0 + params->disc_restitution) * (approach / distance) / params->inverse_mass[PUCK];
    v[PUCK].x -= impulse * params->inverse_mass[PUCK] * nx;
    v[PUCK].y -= impulse * params->inverse_mass[PUCK] * ny;
    if (count < CONTACT_ROWS) {
        double radius = params->radius[PUCK];
        contacts[count] = (Contact){time, a, PUCK, p[PUCK].x + radius * nx, p[PUCK].y + radius * ny, nx, ny, impulse};
    }
    return count + 1;
}

static int strike_edge(State *state, const Parameters *params, double nx, double ny, Contact *contacts, int count, double time)
{
    Vector p = state->position[PUCK], *v = &state->velocity[PUCK];
    double normal = v->x * nx + v->y * ny;
    if (!(normal < 0.0))
        return count;
    double tangent = v->y * nx - v->x * ny;
    double normal_after = -params->wall_restitution * normal, tangent_after = params->wall_tangential * tangent;
    v->x = normal_after * nx - tangent_after * ny;
    v->y = normal_after * ny + tangent_after * nx;
    if (count < CONTACT_ROWS) {
        double radius = params->radius[PUCK], impulse = (normal_after - normal) / params->inverse_mass[PUCK];
        contacts[count] = (Contact){time, PUCK, -1, p.x - radius * nx, p.y - radius * ny, nx, ny, impulse};
    }
    return count + 1;
}

static int resolve(State *state, const Parameters *params, Kiss kiss, Contact *contacts, int count, double time)
{
    Vector *p = &state->position[PUCK];
    if (kiss.kind == DISC)
        return strike_disc(state, params, kiss.which, contacts, count, time);
    if (kiss.kind == WALL) {
        double sign = kiss.which % 2 == 0 ? 1.0 : -1.0;
        if (kiss.which < 2) {
            p->x = sign * (params->half_length - params->radius[PUCK]);
            return strike_edge(state, params, -sign, 0.0, contacts, count, time);
        }
        p->y = sign * (params->half_width - params->radius[PUCK]);
        return strike_edge(state, params, 0.0, -sign, contacts, count, time);
    }
    double end = kiss.which / 2 == 0 ? 1.0 : -1.0, side = kiss.which % 2 == 0 ? 1.0 : -1.0;
    double dx = p->x - end * params->half_length, dy = p->y - side * params->half_goal;
    double distance = sqrt(dx * dx + dy * dy);
    return strike_edge(state, params, dx / distance, dy / distance, contacts, count, time);
}

/* Discs that are squeezed give way; see `relieve` in airhockey_env/engine/impact.py. */
static inline bool relieve(State *state, Kiss kiss, int hits)
{
    if (hits <= CONTACT_LIMIT)
        return false;
    if (kiss.kind == DISC)
        state->velocity[kiss.which] = (Vector){0.0, 0.0};
    if (hits <= 2 * CONTACT_LIMIT)
        return false;
    state->velocity[PUCK] = (Vector){0.0, 0.0};
    return true;
}

static inline void glide(Vector *v, const Parameters *params)
{
    double speed = sqrt(v->x * v->x + v->y * v->y);
    if (speed > 0.0) {
        double share = greatest(0.0, params->glide_p * speed - params->glide_q)
                     / ((params->glide_r * speed + params->glide_s) * speed);
        if (share * speed > params->puck_speed)
            share = params->puck_speed / speed;
        v->x *= share;
        v->y *= share;
    }
}

/* Play one tick. Returns the side of the goal that was hit, or 0. */
static inline int play_tick(State *state, const Parameters *params, Contact *contacts, int32_t *n_contacts)
{
    double elapsed = 0.0;
    int count = 0, hits = 0, goal = 0;
    glide(&state->velocity[PUCK], params);
    for (;;) {
        Kiss kiss = next_kiss(state, params, params->tick - elapsed);
        for (int disc = LEFT; disc <= PUCK; disc++) {
            state->position[disc].x += state->velocity[disc].x * kiss.time;
            state->position[disc].y += state->velocity[disc].y * kiss.time;
        }
        if (kiss.kind == NOTHING)
            break;
        elapsed += kiss.time;
        if (kiss.kind == GOAL) {
            goal = kiss.which == 0 ? 1 : -1;
            state->position[PUCK].x = goal * params->half_length;
            break;
        }
        if (!relieve(state, kiss, ++hits))
            count = resolve(state, params, kiss, contacts, count, elapsed);
    }
    glide(&state->velocity[PUCK], params);
    *n_contacts = count < CONTACT_ROWS ? count : CONTACT_ROWS;
    return goal;
}

/* Rules --------------------------------------------------------------------------------------------------------- */

static inline void give(State *state, int side)
{
    state->side = side;
    state->clock = 0;
    state->plan = draw(state);
}

static void serve(State *state, const Parameters *params, int side)
{
    state->position[LEFT] = (Vector){-HOME * params->half_length, 0.0};
    state->position[RIGHT] = (Vector){HOME * params->half_length, 0.0};
    for (int disc = LEFT; disc <= PUCK; disc++)
        state->velocity[disc] = (Vector){0.0, 0.0};
    state->position[PUCK].x = side * params->half_length * draw_between(state, SERVE_NEAR, SERVE_FAR);
    state->position[PUCK].y = side * params->half_width * draw_between(state, -SERVE_WIDE, SERVE_WIDE);
    give(state, side);
}

static void begin(State *state, const Parameters *params)
{
    state->steps = 0;
    state->score[0] = state->score[1] = 0;
    state->done = false;
    serve(state, params, draw(state) < 0.5 ? -1 : 1);
}

/* Keep the clock after a tick without a goal. Returns whether it ran out. */
static inline bool keep_clock(State *state, const Parameters *params)
{
    if (state->position[PUCK].x * state->side < 0.0) {
        give(state, -state->side);
        return false;
    }
    return ++state->clock > params->clock_limit;
}

static inline void observe(const State *state, const Parameters *params, float *restrict seen)
{
    const Vector *p = state->position, *v = state->velocity;
    for (int paddle = LEFT; paddle <= RIGHT; paddle++) {
        seen[4 * paddle + 0] = (float)(p[paddle].x * params->per_x + 0.0);
        seen[4 * paddle + 1] = (float)(p[paddle].y * params->per_y + 0.0);
        seen[4 * paddle + 2] = (float)(v[paddle].x * params->per_paddle + 0.0);
        seen[4 * paddle + 3] = (float)(v[paddle].y * params->per_paddle + 0.0);
    }
    seen[8] = (float)(p[PUCK].x * params->per_x + 0.0);
    seen[9] = (float)(p[PUCK].y * params->per_y + 0.0);
    seen[10] = (float)(v[PUCK].x * params->per_puck + 0.0);
    seen[11] = (float)(v[PUCK].y * params->per_puck + 0.0);
    double used = state->clock * params->per_clock;
    seen[12] = (float)(state->side < 0 ? used : 0.0 - used);
}

/* The step ------------------------------------------------------------------------------------------------------ */

/* Nothing has happened on table i since its episode began. */
static inline void forget_step(const Outputs *out, int64_t i)
{
    out->n_contacts[i] = 0;
    out->point[i] = 0;
    out->reward[i] = out->right_reward[i] = 0.0;
    out->foul[i] = out->success[i] = out->terminated[i] = out->truncated[i] = false;
}

/* Play one step of the tables `first` to `last` (excluded); `max_steps` truncates an episode. */
void step_rows(int64_t first, int64_t last, State *restrict states, const Parameters *restrict parameters,
               const float *restrict actions, const Outputs *restrict outputs, int32_t max_steps, int32_t autoreset)
{
    const Parameters params = *parameters; /* copies that nothing can write to: they stay in registers */
    const Outputs out = *outputs;
    for (int64_t i = first; i < last; i++) {
        State *state = &states[i];
        if (state->done && autoreset == NEXT_STEP) {
            begin(state, &params);
            forget_step(&out, i);
            out.began[i] = true;
        } else {
            Vector action = {actions[2 * i], actions[2 * i + 1]};
            Vector answer = opponent(state, &params, 1.0);
            drive(state, &params, LEFT, action);
            drive(state, &params, RIGHT, answer);
            int point = play_tick(state, &params, out.contacts + i * CONTACT_ROWS, out.n_contacts + i);
            bool foul = false;
            if (point != 0)
                state->score[point > 0 ? 0 : 1]++;
            else if ((foul = keep_clock(state, &params)))
                serve(state, &params, -state->side);
            bool terminated = state->score[0] >= POINTS || state->score[1] >= POINTS;
            state->steps++;
            bool truncated = max_steps > 0 && state->steps >= max_steps && !terminated;
            state->done = terminated || truncated;
            out.point[i] = (int8_t)point;
            out.foul[i] = foul;
            out.reward[i] = point;
            out.right_reward[i] = -point;
            out.terminated[i] = terminated;
            out.truncated[i] = truncated;
            out.success[i] = terminated && point > 0;
            out.began[i] = false;
            if (state->done && autoreset == SAME_STEP) {
                observe(state, &params, out.final_observation + i * OBSERVATION_SIZE);
                out.final_score[2 * i] = state->score[0];
                out.final_score[2 * i + 1] = state->score[1];
                begin(state, &params);
                out.began[i] = true;
            }
        }
        observe(state, &params, out.observation + i * OBSERVATION_SIZE);
        out.score[2 * i] = state->score[0];
        out.score[2 * i + 1] = state->score[1];
    }
}

/* Begin an episode on the tables `first` to `last` (excluded), whose random streams are set. */
void reset_rows(int64_t first, int64_t last, State *states, const Parameters *params, const Outputs *out)
{
    for (int64_t i = first; i < last; i++) {
        begin(&states[i], params);
        forget_step(out, i);
        out->began[i] = true;
        observe(&states[i], params, out->observation + i * OBSERVATION_SIZE);
        out->score[2 * i] = out->score[2 * i + 1] = 0;
    }
}
