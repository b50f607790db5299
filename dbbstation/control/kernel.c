/* Kinematics of a hexapod with error sources: lengths in mm, angles in degrees, forces in N.
   Generated lines before this one hold the machine: joints Q and P, REFERENCE, STRUT, MIDDLE, LOW, HIGH, weights. */
#define EACH for (int i = 0; i < 6; i++)
#define ALL for (int i = 0; i < 6; i++) for (int k = 0; k < 3; k++)
#define DEG (3.14159265358979323846 / 180.0)

/* A picometre: where the platform is held by a tenth of its usual stiffness, the pose is right to ten of them. */
#define AGREED_MM 1e-9
/* Four to six rounds are usual; a machine that needs more is about to fold. */
#define MOST_ROUNDS 30

enum { FINE, OUT_OF_RANGE, NOT_CONVERGED, THERMOMETER };

/* Struts as a source sees them: length, direction from base to platform, arm R P from tip to platform joint. */
typedef struct { double length[6], unit[6][3], arm[6][3], r[3][3]; } seen_t;
/* What sources add: struts and joints as in the model, and the tip's shift in the platform. */
typedef struct { double strut[6], base[6][3], platform[6][3], tip[3]; } effect_t;

static inline void cross(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1], c[1] = a[2] * b[0] - a[0] * b[2], c[2] = a[0] * b[1] - a[1] * b[0];
}

static inline double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static inline double unify(double *a)
{
    double size = sqrt(dot(a, a));
    a[0] /= size, a[1] /= size, a[2] /= size;
    return size;
}

/* v = R a */
static inline void turned(const double r[3][3], const double *a, double *v)
{
    for (int k = 0; k < 3; k++) v[k] = dot(r[k], a);
}

/* v = transposed R a: a direction of the machine in the platform */
static inline void turned_back(const double r[3][3], const double *a, double *v)
{
    for (int k = 0; k < 3; k++) v[k] = r[0][k] * a[0] + r[1][k] * a[1] + r[2][k] * a[2];
}

/* Rx(A) Ry(B) Rz(C), or Rz(C) Ry(B) Rx(A), which is the transpose of the first with its angles negative. */
static void rotation(const double *abc, double r[3][3])
{
    double s = ZYX ? -1.0 : 1.0, m[3][3];
    double ca = cos(abc[0] * DEG), cb = cos(abc[1] * DEG), cc = cos(abc[2] * DEG);
    double sa = s * sin(abc[0] * DEG), sb = s * sin(abc[1] * DEG), sc = s * sin(abc[2] * DEG);
    m[0][0] = cb * cc, m[0][1] = -cb * sc, m[0][2] = sb;
    m[1][0] = ca * sc + sa * sb * cc, m[1][1] = ca * cc - sa * sb * sc, m[1][2] = -sa * cb;
    m[2][0] = sa * sc - ca * sb * cc, m[2][1] = sa * cc + ca * sb * sc, m[2][2] = ca * cb;
    for (int i = 0; i < 3; i++) for (int k = 0; k < 3; k++) r[i][k] = ZYX ? m[k][i] : m[i][k];
}

static void angles(const double r[3][3], double *abc)
{
    double s = ZYX ? 1.0 : -1.0, m[3][3];
    for (int i = 0; i < 3; i++) for (int k = 0; k < 3; k++) m[i][k] = ZYX ? r[i][k] : r[k][i];
    abc[0] = s * atan2(m[2][1], m[2][2]) / DEG;
    abc[1] = s * atan2(-m[2][0], sqrt(m[2][1] * m[2][1] + m[2][2] * m[2][2])) / DEG;
    abc[2] = s * atan2(m[1][0], m[0][0]) / DEG;
}

static void look(const double q[6][3], const double p[6][3], const double *t, const double r[3][3], seen_t *at)
{
    for (int i = 0; i < 3; i++) for (int k = 0; k < 3; k++) at->r[i][k] = r[i][k];
    EACH {
        turned(r, p[i], at->arm[i]);
        for (int k = 0; k < 3; k++) at->unit[i][k] = t[k] + at->arm[i][k] - q[i][k];
        at->length[i] = unify(at->unit[i]);
    }
}

/* Gauss elimination with exchanged rows: m x = b, b becomes x; not a number where m is singular. Returns the determinant. */
static double solve(double m[6][6], double *b)
{
    double volume = 1.0;
    for (int k = 0; k < 6; k++) {
        int most = k;
        for (int i = k + 1; i < 6; i++) if (fabs(m[i][k]) > fabs(m[most][k])) most = i;
        for (int j = k; j < 6; j++) { double x = m[k][j]; m[k][j] = m[most][j], m[most][j] = x; }
        double y = b[k]; b[k] = b[most], b[most] = y;
        volume *= most == k ? m[k][k] : -m[k][k];
        for (int i = k + 1; i < 6; i++) {
            double share = m[i][k] / m[k][k];
            for (int j = k + 1; j < 6; j++) m[i][j] -= share * m[k][j];
            b[i] -= share * b[k];
        }
    }
    for (int k = 5; k >= 0; k--) {
        for (int j = k + 1; j < 6; j++) b[k] -= m[k][j] * b[j];
        b[k] /= m[k][k];
    }
    return volume;
}

/* Struts' directions and moments about the tip: a row each. */
static inline void jacobian(const seen_t *at, double m[6][6])
{
    EACH {
        double turn[3];
        cross(at->arm[i], at->unit[i], turn);
        for (int k = 0; k < 3; k++) m[i][k] = at->unit[i][k], m[i][3 + k] = turn[k];
    }
}

/* Whether the struts hold the platform; beyond, loads stretch them without end, and another pose has the same joints. */
static int held(const seen_t *at)
{
    double m[6][6], none[6] = {0.0};
    jacobian(at, m);
    return solve(m, none) / HELD >= 1.0;
}

/* Axial forces under a load of force and moment about the tip: sum T u = F, sum T (arm x u) = M. */
static inline void tensions(const seen_t *at, const double *load, double *t)
{
    double m[6][6], turn[3];
    EACH {
        cross(at->arm[i], at->unit[i], turn);
        for (int k = 0; k < 3; k++) m[k][i] = at->unit[i][k], m[3 + k][i] = turn[k];
        t[i] = load[i];
    }
    solve(m, t);
}

/* The platform's weight on its axis, above the tip. */
static inline void platform_load(const seen_t *at, double *load)
{
    double weight[3] = {0.0, 0.0, -WEIGHT}, lever[3], moment[3];
    for (int k = 0; k < 3; k++) lever[k] = ABOVE * at->r[k][2];
    cross(lever, weight, moment);
    for (int k = 0; k < 3; k++) load[k] += weight[k], load[3 + k] += moment[k];
}

/* Transverse pull of struts on the platform; kg holds strut, motor, motor length, screw, screw length [kg, mm]. */
static inline void strut_load(const seen_t *at, const double *kg, double *load, double pull[6][3])
{
    double moment[3];
    EACH {
        double l = at->length[i], z = at->unit[i][2];
        double share = (kg[0] * l / 2.0 - kg[1] * kg[2] / 2.0 + kg[3] * (l - kg[4] / 2.0)) / l * GRAVITY;
        for (int k = 0; k < 3; k++) pull[i][k] = share * ((k == 2 ? -1.0 : 0.0) + z * at->unit[i][k]);
        cross(at->arm[i], pull[i], moment);
        for (int k = 0; k < 3; k++) load[k] += pull[i][k], load[3 + k] += moment[k];
    }
}

/* Stretch per force of a strut whose compliance is c at 1000 mm. */
static inline double stretch(const seen_t *at, int i, double c)
{
    return c * (1.0 - SHARE + SHARE * at->length[i] / 1000.0);
}

/* A curve of n even points from low to high, constant beyond. */
static inline double curve(const double *y, int n, double low, double high, double x)
{
    double place = (x - low) / (high - low) * (n - 1);
    if (!(place > 0.0)) return y[0];
    if (place >= n - 1) return y[n - 1];
    int k = (int)place;
    return y[k] + (place - k) * (y[k + 1] - y[k]);
}

static void by_command(const seen_t *at, effect_t *e);
static void by_weight(const seen_t *at, effect_t *e);
static int rounds;

/* One Newton step towards struts longer by `more`; Cayley's matrix keeps R a rotation. */
static void step(const seen_t *at, const double *more, double *t, double r[3][3])
{
    double m[6][6], x[6], new[3][3];
    jacobian(at, m);
    EACH x[i] = more[i];
    solve(m, x);
    const double *w = x + 3;
    double c = 1.0 / (1.0 + 0.25 * dot(w, w)), h = 0.5 * c;
    for (int k = 0; k < 3; k++) {
        double column[3] = {r[0][k], r[1][k], r[2][k]}, once[3], twice[3];
        cross(w, column, once), cross(w, once, twice);
        for (int i = 0; i < 3; i++) new[i][k] = column[i] + c * once[i] + h * twice[i];
        t[k] += x[k];
    }
    for (int i = 0; i < 3; i++) for (int k = 0; k < 3; k++) r[i][k] = new[i][k];
}

/* The pose of joints q and p whose struts are as long as wanted, plus what sources add that follow the place. */
static int reach(const double *wanted, const effect_t *firm, int weighing, double *t, double r[3][3], seen_t *at)
{
    effect_t e = *firm;
    double q[6][3], p[6][3], more[6];
    ALL q[i][k] = Q[i][k] + e.base[i][k], p[i][k] = P[i][k] + e.platform[i][k];
    look(q, p, t, r, at);
    for (int round = 1; round <= MOST_ROUNDS; round++) {
        double most = 0.0;
        if (weighing) {
            e = *firm;
            by_weight(at, &e);
            ALL q[i][k] = Q[i][k] + e.base[i][k], p[i][k] = P[i][k] + e.platform[i][k];
            look(q, p, t, r, at);
        }
        EACH {
            more[i] = wanted[i] + e.strut[i] - at->length[i];
            if (!(fabs(more[i]) <= most)) most = fabs(more[i]);
        }
        if (round > rounds) rounds = round;
        if (most < AGREED_MM) return FINE;
        step(at, more, t, r);
        look(q, p, t, r, at);
    }
    return NOT_CONVERGED;
}

/* The struts at which a source of the command looks: those of the nominal machine at joints. */
static int commanded(const double *joint, double *t, double r[3][3], seen_t *at)
{
    static const effect_t none;
    double length[6];
    EACH length[i] = at->length[i] = joint[i] + REFERENCE[i];
    return BY_POSE ? reach(length, &none, 0, t, r, at) : FINE;
}

static int in_range(const double *joint)
{
    EACH if (!(joint[i] >= STRUT[0] && joint[i] <= STRUT[1])) return 0;
    return 1;
}

/* Joints that take the tip to a pose X, Y, Z, A, B, C. */
int dbb_inverse(const double *pose, double *joint)
{
    double r[3][3], command_r[3][3], t[3], command_t[3], tip[3], q[6][3], p[6][3], found[6];
    seen_t command, there;
    int wrong = NOT_CONVERGED;
    rounds = 0;
    rotation(pose + 3, r), rotation(pose + 3, command_r);
    for (int k = 0; k < 3; k++) command_t[k] = pose[k];
    look(Q, P, pose, r, &command);
    there = command;
    EACH found[i] = command.length[i] - REFERENCE[i];
    for (int round = 0; round < MOST_ROUNDS && wrong; round++) {
        effect_t e = {{0.0}};
        double most = 0.0;
        by_command(&command, &e);
        by_weight(&there, &e);
        turned(r, e.tip, tip);
        for (int k = 0; k < 3; k++) t[k] = pose[k] - tip[k];
        ALL q[i][k] = Q[i][k] + e.base[i][k], p[i][k] = P[i][k] + e.platform[i][k];
        look(q, p, t, r, &there);
        EACH {
            double new = there.length[i] - e.strut[i];
            if (!(fabs(new - found[i]) <= most)) most = fabs(new - found[i]);
            found[i] = new;
        }
        if (most < AGREED_MM) wrong = FINE;
        else if (commanded(found, command_t, command_r, &command)) break;
    }
    if (wrong || !held(&there)) return NOT_CONVERGED;
    if (!in_range(found)) return OUT_OF_RANGE;
    EACH joint[i] = found[i];
    return FINE;
}

static int forward_from(const double *joint, const double *near, double *pose)
{
    double r[3][3], t[3], tip[3];
    seen_t command, there;
    effect_t firm = {{0.0}};
    rotation(near + 3, r);
    for (int k = 0; k < 3; k++) t[k] = near[k];
    if (commanded(joint, t, r, &command)) return NOT_CONVERGED;
    by_command(&command, &firm);
    if (reach(joint, &firm, 1, t, r, &there) || !held(&there)) return NOT_CONVERGED;
    turned(r, firm.tip, tip);
    for (int k = 0; k < 3; k++) pose[k] = t[k] + tip[k];
    angles(r, pose + 3);
    return FINE;
}

/* The pose at joints; `pose` comes with one nearby. From outside the travel the search begins in its middle. */
int dbb_forward(const double *joint, double *pose)
{
    int near = 1;
    rounds = 0;
    if (!in_range(joint)) return OUT_OF_RANGE;
    EACH near = near && pose[i] >= LOW[i] && pose[i] <= HIGH[i];
    if (near && forward_from(joint, pose, pose) == FINE) return FINE;
    return forward_from(joint, MIDDLE, pose);
}
