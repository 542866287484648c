/* A trained policy: the weights of a fully connected network. */

#include <stdbool.h>
#include <stdint.h>

typedef struct {
    const float *parameters; /* for one layer after the other, the weights (in, out) and the biases (out,) */
    const int32_t *sizes;    /* (layers + 1,) units of every layer, the inputs first */
    int32_t layers;
    bool use_tanh; /* between the layers; else the greater of x and 0 */
    bool squash;   /* whether the outputs go through tanh */
    float *room;   /* for the numbers of two layers: twice the widest one */
} Policy;

/* The outputs of the network; they stay there until the next call. */
const float *forward(const Policy *policy, const float *observation);
