/* The forward pass of airhockey_env/opponents/policy.py in C.
 *
 * Every expression is evaluated in the same order and in float32, so that it gives the same bits. Compile it without
 * contraction and fast-math, as docs/play/build.py does.
 */

#include "policy.h"

/* tanh to float32's precision; see airhockey_env/opponents/policy.py. */
static float rational_tanh(float x)
{
    static const float end = 7.90531110763549805f;
    static const float odds[] = {-2.76076847742355e-16f, 2.00018790482477e-13f, -8.60467152213735e-11f,
                                 5.12229709037114e-08f,  1.48572235717979e-05f, 6.37261928875436e-04f,
                                 4.89352455891786e-03f};
    static const float evens[] = {1.19825839466702e-06f, 1.18534705686654e-04f, 2.26843463243900e-03f,
                                  4.89352518554385e-03f};
    x = x > end ? end : x;
    x = x < -end ? -end : x;
    float x2 = x * x, odd = odds[0], even = evens[0];
    for (int k = 1; k < 7; k++)
        odd = odd * x2 + odds[k];
    for (int k = 1; k < 4; k++)
        even = even * x2 + evens[k];
    return x * odd / even;
}

const float *forward(const Policy *policy, const float *observation)
{
    const float *parameters = policy->parameters, *here = observation;
    int32_t widest = 0;
    for (int32_t layer = 1; layer <= policy->layers; layer++)
        widest = policy->sizes[layer] > widest ? policy->sizes[layer] : widest;
    for (int32_t layer = 0; layer < policy->layers; layer++) {
        int32_t n_in = policy->sizes[layer], n_out = policy->sizes[layer + 1];
        const float *bias = parameters + n_in * n_out;
        float *there = policy->room + (layer % 2 ? widest : 0);
        for (int32_t j = 0; j < n_out; j++)
            there[j] = bias[j];
        for (int32_t k = 0; k < n_in; k++, parameters += n_out)
            for (int32_t j = 0; j < n_out; j++)
                there[j] += here[k] * parameters[j];
        parameters = bias + n_out;
        bool last = layer == policy->layers - 1;
        for (int32_t j = 0; j < n_out; j++)
            if (last ? policy->squash : policy->use_tanh)
                there[j] = rational_tanh(there[j]);
            else if (!last)
                there[j] = there[j] > 0.0f ? there[j] : 0.0f;
        here = there;
    }
    return here;
}
