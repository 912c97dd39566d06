/* The first pass over some poses, one by one. */
static void arm_first_pass(arm_state *state, int count)
{
    int i;
    for (i = 0; i < count; i++)
        state[i].open = arm_attempt(state[i].goal, state[i].kind, 0, state[i].found, &state[i].number, &state[i].edge);
}
