/* @NAME@.c: see @NAME@.h */
#include "@NAME@.h"
#include <float.h>
#include <math.h>

#ifdef __clang__
#pragma STDC FP_CONTRACT OFF
#endif

typedef @NAME@_real real;
@DEFINES@
const @NAME@_parameters @NAME@_defaults = {
@DEFAULTS@
};
@TABLES@@HELPERS@
int @NAME@(const @NAME@_parameters *p, const @NAME@_inputs *in, @NAME@_outputs *out)
{
@BODY@
    return (int)(@WORD@);
}
