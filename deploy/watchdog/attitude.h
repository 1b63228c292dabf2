/* How a robot that flies stays upright while it hears nothing: the same as
 * hardware/attitude_keeper.py, which explains it and makes the numbers. Others need none.
 */
#ifndef LIGHTLEASH_ATTITUDE_H
#define LIGHTLEASH_ATTITUDE_H

#include <stdbool.h>
#include <stdint.h>

#define LL_MAX_THRUSTERS 16

typedef struct {
    double lift_row[LL_MAX_THRUSTERS];    /* lift of the body [N] per thrust [N] */
    double lift_column[LL_MAX_THRUSTERS]; /* thrusts [N] per lift [N], without torque */
    double gain[LL_MAX_THRUSTERS][6];     /* thrusts per rotation to the upright [rad], rate [rad/s] */
} ll_attitude_gains;

typedef struct {
    double up[3], level[3], rate[3], bias[3]; /* body axes */
} ll_attitude;

void ll_attitude_init(ll_attitude *a);

/* Take a sample [rad/s], [m/s2], h >= 0 seconds after the last; `at_rest`: thrusters off since
 * then. One that is no number is skipped. */
void ll_attitude_add_imu(ll_attitude *a, const float gyro[3], const float accelerometer[3],
                         double h, bool at_rest);

/* From the thrusts of the ramp: their lift, and torques against tilt and turning. In place, within
 * [0, f_max]. */
void ll_attitude_thrusts(const ll_attitude *a, const ll_attitude_gains *g, uint8_t n, double f_max,
                         double *thrusts);

#endif
