/* An ego controller over LCM in C: round the goals in order, straight across country.
 *
 * Build it where lcm is the folder of the library (of a virtual environment: its site-packages):
 *   dubins-traffic lcm messages -o messages.lcm && lcm-gen -c messages.lcm
 *   cc -o controller controller.c dubins_traffic_lcm_*.c -I. -I$lcm/include -L$lcm/lib -Wl,-rpath,$lcm/lib -llcm -lm
 * Start it beside `dubins-traffic lcm run demo --lockstep`; it drives trial after trial until it is interrupted.
 */
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <unistd.h>

#include <lcm/lcm.h>

#include "dubins_traffic_lcm_command_t.h"
#include "dubins_traffic_lcm_instance_t.h"
#include "dubins_traffic_lcm_mode_t.h"
#include "dubins_traffic_lcm_state_t.h"

static const double SPEED = 0.5, YAW_RATE = 0.9, TOLERANCE = 0.1;

static dubins_traffic_lcm_instance_t *instance; /* the present problem, NULL before the first */
static dubins_traffic_lcm_command_t command;    /* the latest answer */
static int next_goal;
static volatile sig_atomic_t interrupted;

static void begin(const lcm_recv_buf_t *buffer, const char *channel,
                  const dubins_traffic_lcm_instance_t *message, void *user) {
    (void) buffer, (void) channel, (void) user;
    if (instance != NULL && instance->trial == message->trial)
        return; /* it may come more than once */
    if (instance != NULL)
        dubins_traffic_lcm_instance_t_destroy(instance);
    instance = dubins_traffic_lcm_instance_t_copy(message);
    next_goal = 0;
    command.tick = -1;
}

static void decide(const dubins_traffic_lcm_car_t *car) {
    const double *goal = instance->intersection[instance->goal[next_goal]];
    double x = goal[0] - car->x, y = goal[1] - car->y;
    double error = remainder(atan2(y, x) - atan2(car->s, car->c), 2.0 * M_PI);
    if (hypot(x, y) < instance->radius / 2.0)
        next_goal = (next_goal + 1) % instance->goals;
    command.speed = fabs(error) > TOLERANCE ? 0.0 : SPEED;
    command.yaw_rate = fabs(error) > TOLERANCE ? copysign(YAW_RATE, error) : 0.0;
}

static void drive(const lcm_recv_buf_t *buffer, const char *channel,
                  const dubins_traffic_lcm_state_t *state, void *user) {
    (void) buffer, (void) channel;
    if (instance == NULL || state->trial != instance->trial || instance->goals == 0)
        return;
    if (state->tick > command.tick) { /* a state that comes again is answered as before */
        command.trial = state->trial;
        command.tick = state->tick;
        decide(&state->own);
    }
    dubins_traffic_lcm_command_t_publish(user, "TRAFFIC_COMMAND_ego", &command);
}

static void interrupt(int signal) {
    (void) signal;
    interrupted = 1;
}

int main(void) {
    const char *url = getenv("LCM_DEFAULT_URL");
    lcm_t *lcm = lcm_create(url != NULL ? url : "udpm://239.255.76.67:7667?ttl=0");
    if (lcm == NULL)
        return 1;
    signal(SIGINT, interrupt);
    signal(SIGTERM, interrupt);
    dubins_traffic_lcm_instance_t_subscribe(lcm, "TRAFFIC_INSTANCE", begin, NULL);
    dubins_traffic_lcm_state_t_subscribe(lcm, "TRAFFIC_STATE_ego", drive, lcm);
    dubins_traffic_lcm_mode_t ready = {getpid(), DUBINS_TRAFFIC_LCM_MODE_T_READY};
    dubins_traffic_lcm_mode_t start = {getpid(), DUBINS_TRAFFIC_LCM_MODE_T_START};
    while (!interrupted) {
        if (lcm_handle_timeout(lcm, 500) == 0) { /* silence: say that we are here, and that a trial may begin */
            dubins_traffic_lcm_mode_t_publish(lcm, "TRAFFIC_MODE", &ready);
            dubins_traffic_lcm_mode_t_publish(lcm, "TRAFFIC_MODE", &start);
        }
    }
    if (instance != NULL)
        dubins_traffic_lcm_instance_t_destroy(instance);
    lcm_destroy(lcm);
    return 0;
}
