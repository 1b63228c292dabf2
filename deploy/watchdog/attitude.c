#include "attitude.h"

#include <math.h>
#include <string.h>

#define DRAWN_PER_S 0.2
#define DRAWN_AT_REST_PER_S 2.0
#define LEARNT_PER_S 1.0
#define AT_REST_RAD_S 0.05

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static double norm(const double a[3])
{
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

void ll_attitude_init(ll_attitude *a)
{
    memset(a, 0, sizeof *a);
    a->up[2] = a->level[2] = 1.0;
}

void ll_attitude_add_imu(ll_attitude *a, const float gyro[3], const float accelerometer[3],
                         double h, bool at_rest)
{
    const double read[3] = {gyro[0], gyro[1], gyro[2]};
    const double force[3] = {accelerometer[0], accelerometer[1], accelerometer[2]};
    double turned[3], size = norm(force), drawn = at_rest ? DRAWN_AT_REST_PER_S : DRAWN_PER_S;
    bool learns = at_rest && norm(read) < AT_REST_RAD_S;
    if (!isfinite(norm(read)) || !isfinite(size))
        return;
    for (int i = 0; i < 3; i++) {
        if (learns)
            a->bias[i] += h * LEARNT_PER_S * (read[i] - a->bias[i]);
        a->rate[i] = read[i] - a->bias[i];
    }
    cross(a->rate, a->up, turned);
    for (int i = 0; i < 3; i++) {
        a->up[i] -= h * turned[i];
        if (size > 1.0)
            a->up[i] += h * drawn * (force[i] / size - a->up[i]);
    }
    double length = norm(a->up);
    for (int i = 0; i < 3; i++) {
        a->up[i] /= length;
        if (at_rest)
            a->level[i] = a->up[i];
    }
}

void ll_attitude_thrusts(const ll_attitude *a, const ll_attitude_gains *g, uint8_t n, double f_max,
                         double *thrusts)
{
    double upright[3], torque[LL_MAX_THRUSTERS], lift = 0.0, share = 1.0;
    cross(a->level, a->up, upright);
    for (int i = 0; i < n; i++)
        lift += g->lift_row[i] * thrusts[i];
    for (int i = 0; i < n; i++) {
        torque[i] = 0.0;
        for (int k = 0; k < 3; k++)
            torque[i] += g->gain[i][k] * upright[k] + g->gain[i][k + 3] * a->rate[k];
        thrusts[i] = fmin(fmax(g->lift_column[i] * fmax(0.0, lift), 0.0), f_max);
        double room = torque[i] < 0.0 ? thrusts[i] : f_max - thrusts[i];
        if (fabs(torque[i]) > room)
            share = fmin(share, room / fabs(torque[i]));
    }
    for (int i = 0; i < n; i++)
        thrusts[i] = fmin(fmax(thrusts[i] + share * torque[i], 0.0), f_max);
}
