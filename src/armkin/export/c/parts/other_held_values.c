    for (k = 1; *edge && k <= 32; k++) { /* a joint that is free may be out of reach where near has it: ask elsewhere */
        const arm_real turn = (arm_real)(k % 2 ? k + 1 : -k) * (ARM_TURN / 66);
        arm_real other[ARM_JOINTS];
        int doubt, found = 0;
        for (b = 0; b < ARM_BRANCHES; b++)
            found |= miss[b] <= ARM_SOLUTION;
        if (found)
            break;
        for (j = 0; j < ARM_JOINTS; j++)
            other[j] = near[j] + (arm_slides[j] ? turn * @reach@ / ARM_TURN : turn);
        arm_candidates(goal, other, q, miss, &doubt, 1);
    }
