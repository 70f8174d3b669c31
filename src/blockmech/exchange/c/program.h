/* @TITLE@
   Written by blockmech @VERSION@ (@HOW@). SI, radians.

   cc @FLAGS@ -c @NAME@.c     (link with -lm)
   cc @FLAGS@ @NAME@.c @NAME@_test.c -lm -o @NAME@_test && ./@NAME@_test

   With -ffp-contract=off the numbers are those of blockmech to the last bit where
   sin, cos and atan2 are the same. No heap, no static data that change.
   @NAME@() returns @REASONS@;
   where it is not 0, outputs that have no value are not finite.
@LEFTOUT@*/
#ifndef @GUARD@
#define @GUARD@

#ifdef __cplusplus
extern "C" {
#endif

typedef @REAL@ @NAME@_real;
#define real @NAME@_real

typedef struct {
@PARAMETERS@
} @NAME@_parameters;

typedef struct {
@INPUTS@
} @NAME@_inputs;

typedef struct {
@OUTPUTS@
} @NAME@_outputs;
#undef real

extern const @NAME@_parameters @NAME@_defaults;

int @NAME@(const @NAME@_parameters *p, const @NAME@_inputs *in, @NAME@_outputs *out);

#ifdef __cplusplus
}
#endif
#endif
