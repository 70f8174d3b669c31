/* @NAME@_test.c: the answers of blockmech for poses of the mechanism's range */
#include "@NAME@.h"
#include <math.h>
#include <stdio.h>

typedef @NAME@_real real;
static const real given[@POSES@][@WIDTH@] = {
@GIVEN@
};
static const real expected[@POSES@][@COUNT@] = {
@EXPECTED@
};
static const real allowed[@COUNT@] = {
@ALLOWED@
};
static const int words[@POSES@] = {@WORDS@};

int main(void)
{
    int wrong = 0;
    for (int i = 0; i < @POSES@; ++i) {
        const @NAME@_inputs in = {@TAKEN@};
        @NAME@_outputs out;
        const int word = @NAME@(&@NAME@_defaults, &in, &out);
        const real found[@COUNT@] = {@MEMBERS@};
        if (word != words[i]) {
            printf("pose %d: returns %d, expected %d\n", i, word, words[i]);
            ++wrong;
            continue;
        }
        for (int j = 0; word == 0 && j < @COUNT@; ++j)
            if (isfinite(expected[i][j]) &&
                !(fabs((double)found[j] - (double)expected[i][j]) <= (double)allowed[j])) {
                printf("pose %d, output %d: %.17g, expected %.17g\n", i, j,
                       (double)found[j], (double)expected[i][j]);
                ++wrong;
            }
    }
    printf("@NAME@: %d of @POSES@ poses x @COUNT@ outputs differ\n", wrong);
    return wrong != 0;
}
