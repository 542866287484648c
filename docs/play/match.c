/* One match of the game in C (benchmarks/speed/airhockey.c) for WebAssembly, against the striker or a trained policy.
 *
 * A page writes the table's parameters and a policy into memory, starts a match, and plays its steps one by one. Its
 * results are the same, to the bit, as those of `Game` in airhockey_env/game.py with the same actions; a replay that the
 * page saves plays back in Python.
 */

#include "../../benchmarks/speed/airhockey.c"
#include "policy.h"

#define EXPORT(name) __attribute__((export_name(#name)))

enum { NOTHING_HAPPENED, LEFT_SCORED, RIGHT_SCORED, FOUL };

/* All fields of STATE (airhockey_env/kernel/state.py), in its order: what a replay begins and ends with. */
typedef struct {
    Vector position[3], velocity[3];
    uint64_t stream;
    double plan, wander[2][2], skill[2];
    int32_t member[2], score[2], steps, clock, side, done;
} SavedState;

static Parameters params;
static State state;
static SavedState saved;
static Policy policy;
static Contact contacts[CONTACT_ROWS];
static int32_t n_contacts, points, hold, held;
static double skill;
static float answer[2];

extern unsigned char __heap_base;
static uintptr_t used;

/* Memory that stays in use, for the page to write to. Zero if there is no more. */
EXPORT(allocate) uintptr_t allocate(uintptr_t bytes)
{
    if (used == 0)
        used = (uintptr_t)&__heap_base;
    uintptr_t begin = (used + 7) / 8 * 8, pages = __builtin_wasm_memory_size(0);
    uintptr_t needed = (begin + bytes + 65535) / 65536;
    if (needed > pages && __builtin_wasm_memory_grow(0, needed - pages) == (uintptr_t)-1)
        return 0;
    used = begin + bytes;
    return begin;
}

/* Where things are in memory. */
EXPORT(parameters) Parameters *parameters_at(void) { return &params; }
EXPORT(contacts) const Contact *contacts_at(void) { return contacts; }
EXPORT(answer) const float *answer_at(void) { return answer; }

/* How many contacts the last step had. */
EXPORT(contactCount) int32_t contact_count(void) { return n_contacts; }

/* The state of the match now. */
EXPORT(save) const SavedState *save(void)
{
    saved = (SavedState){.stream = state.stream, .plan = state.plan, .skill = {1.0, skill}};
    for (int disc = LEFT; disc <= PUCK; disc++) {
        saved.position[disc] = state.position[disc];
        saved.velocity[disc] = state.velocity[disc];
    }
    saved.score[0] = state.score[0];
    saved.score[1] = state.score[1];
    saved.steps = state.steps;
    saved.clock = state.clock;
    saved.side = state.side;
    saved.done = state.done;
    return &saved;
}

/* Set who plays on the right from the next match on: a policy whose answer holds for so many steps. */
EXPORT(setPolicy)
void set_policy(const float *parameters, const int32_t *sizes, int32_t layers, bool use_tanh, bool squash, float *room,
                int32_t steps)
{
    policy = (Policy){parameters, sizes, layers, use_tanh, squash, room};
    hold = steps;
}

/* The striker plays on the right from the next match on. */
EXPORT(setStriker) void set_striker(void) { hold = 0; }

/* Begin a match from a state of the random stream; the right player uses a share of its paddle's speed. */
EXPORT(start) void start(uint64_t stream, int32_t points_to_win, double right_skill)
{
    state = (State){.stream = stream};
    points = points_to_win;
    skill = right_skill;
    held = 0;
    n_contacts = 0;
    answer[0] = answer[1] = 0.0f;
    begin(&state, &params);
}

/* The table as the right player sees it, turned by 180 degrees. */
static State turned(const State *seen)
{
    State view = *seen;
    for (int disc = LEFT; disc <= PUCK; disc++) {
        int other = disc == PUCK ? PUCK : RIGHT - disc;
        view.position[disc] = (Vector){-seen->position[other].x, -seen->position[other].y};
        view.velocity[disc] = (Vector){-seen->velocity[other].x, -seen->velocity[other].y};
    }
    view.side = -seen->side;
    return view;
}

static float clip(float value) { return value < -1.0f ? -1.0f : value > 1.0f ? 1.0f : value; }

static Vector right_action(void)
{
    if (hold == 0)
        return opponent(&state, &params, skill);
    if (held == 0) {
        float observation[OBSERVATION_SIZE];
        State view = turned(&state);
        observe(&view, &params, observation);
        const float *out = forward(&policy, observation);
        for (int k = 0; k < 2; k++)
            answer[k] = clip(out[k]) * (float)skill;
        held = hold;
    }
    held--;
    return (Vector){answer[0], answer[1]};
}

/* Play one step; the action is the left player's. Returns what happened. */
EXPORT(step) int32_t step(float x, float y)
{
    if (state.done)
        return NOTHING_HAPPENED;
    Vector theirs = right_action();
    drive(&state, &params, LEFT, (Vector){x, y});
    drive(&state, &params, RIGHT, theirs);
    int point = play_tick(&state, &params, contacts, &n_contacts);
    bool foul = false;
    if (point != 0) {
        int32_t score = ++state.score[point > 0 ? 0 : 1];
        state.done = score >= points;
        if (!state.done)
            serve(&state, &params, point);
    } else if ((foul = keep_clock(&state, &params))) {
        serve(&state, &params, -state.side);
    }
    state.steps++;
    return point > 0 ? LEFT_SCORED : point < 0 ? RIGHT_SCORED : foul ? FOUL : NOTHING_HAPPENED;
}
