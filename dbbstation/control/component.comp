component $name "Kinematics of $machine with the errors of the model $short";
description "Made by dbbstation from a model; do not edit. Model SHA-256 $digest.";
pin in bit enabled "connect to motion.motion-enabled: switches are taken while it is false";
pin out u32 model "first 32 bits of the model's SHA-256";
pin out u32 fault "the last one since the machine was switched on: 0 none, 1 a strut leaves its range, 2 no convergence or the machine is about to fold, 3 a thermometer stands still or is out of range";
pin out u32 iterations "rounds of the last call";
pin out float correction-#[6] "joint less that of the nominal machine [mm]";
param rw float patience_s = $patience "a thermometer that stands still for so long is a fault";
$pins
option singleton yes;
function check nofp "does nothing; halcompile wants one";
license "GPL"; // version 2 or later, as LinuxCNC that it is built for
author "dbbstation";
;;
#include <rtapi_math.h>
#include <kinematics.h>

$mathematics

FUNCTION(check) { }

static int settled(struct __comp_state *__comp_inst);

static int answered(struct __comp_state *__comp_inst, int wrong)
{
    if (wrong) fault = wrong; /* the way back to joints that are right must not hide it */
    iterations = rounds;
    return wrong ? -1 : 0;
}

int kinematicsInverse(const EmcPose *world, double *joint, const KINEMATICS_INVERSE_FLAGS *iflags, KINEMATICS_FORWARD_FLAGS *fflags)
{
    struct __comp_state *__comp_inst = __comp_first_inst;
    double pose[6] = {world->tran.x, world->tran.y, world->tran.z, world->a, world->b, world->c}, r[3][3];
    seen_t plain;
    int wrong = settled(__comp_inst);
    if (!wrong) wrong = dbb_inverse(pose, joint);
    if (!wrong) {
        rotation(pose + 3, r), look(Q, P, pose, r, &plain);
        EACH correction(i) = joint[i] + REFERENCE[i] - plain.length[i];
    }
    return answered(__comp_inst, wrong);
}

int kinematicsForward(const double *joint, EmcPose *world, const KINEMATICS_FORWARD_FLAGS *fflags, KINEMATICS_INVERSE_FLAGS *iflags)
{
    struct __comp_state *__comp_inst = __comp_first_inst;
    double pose[6] = {world->tran.x, world->tran.y, world->tran.z, world->a, world->b, world->c};
    int homed = 0, wrong;
    EACH homed = homed || joint[i] != 0.0;
    if (!homed) return -1; /* before homing: no pose, and no fault */
    wrong = settled(__comp_inst);
    if (!wrong) wrong = dbb_forward(joint, pose);
    if (!wrong) {
        world->tran.x = pose[0], world->tran.y = pose[1], world->tran.z = pose[2];
        world->a = pose[3], world->b = pose[4], world->c = pose[5];
    }
    return answered(__comp_inst, wrong);
}

KINEMATICS_TYPE kinematicsType(void) { return KINEMATICS_BOTH; }
KINS_NOT_SWITCHABLE
EXPORT_SYMBOL(kinematicsType);
EXPORT_SYMBOL(kinematicsForward);
EXPORT_SYMBOL(kinematicsInverse);
$thermometer
static int settled(struct __comp_state *__comp_inst)
{
    static int was_enabled;
    model = 0x${first}u;
    if (enabled && !was_enabled) fault = FINE;
    was_enabled = enabled;
    if (!enabled) {
$switches    }
$watched    return FINE;
}
