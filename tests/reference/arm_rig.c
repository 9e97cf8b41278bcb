/* Arms of bus servos by small fixed steps: rigid bodies by Newton and Euler, friction as bounds of an implicit step.

Written from the specification alone. One step of h: firmware of servos whose tick is due, the supply that all share,
then the speeds at the step's end, with back-EMF, contact of teeth and dry friction implicit. Joints turn about their z.
*/
#include <math.h>
#include <string.h>

#define MOST 8
#define WIDE (2 * MOST)

typedef struct { double turn[9], place[3], mass, centre[3], inertia[6]; } Link;  /* inertia: xx yy zz xy xz yz */

typedef struct {
    double R, K, J, B, forward, backward, breakaway, stribeck, load_motor, load_external;  /* at the output shaft */
    double drop, slope, brush;                       /* of the bridge [V, ohm] and of the brushes [V] */
    double play, bearing, stiffness, damping, wheel; /* of the teeth; the wheel is behind them */
    double zero;                                     /* the encoder's angle less that of the joint [rad] */
    double dynamixel, P, D, zone, startup, limit, torque_limit, speed, acceleration, least_speed, slew, wait, phase;
} Servo;

typedef struct {
    double y, r, speed, goal, z[21], held, duty, waiting, next;
    long count;
    int on_course, taken;
    double at;
} Mind;

static const double DELTA = 6.283185307179586 / 4096.0;

static double sign_of(double x) { return (x > 0.0) - (x < 0.0); }
static double cut(double x) { double n = nearbyint(x); return fabs(x - n) < 1e-9 ? n : trunc(x); }
static double clip(double x, double b) { return x > b ? b : x < -b ? -b : x; }

static void rotation(const double *fixed, double q, double *out) {
    double c = cos(q), s = sin(q);
    for (int i = 0; i < 3; i++) {
        out[3 * i] = fixed[3 * i] * c + fixed[3 * i + 1] * s;
        out[3 * i + 1] = -fixed[3 * i] * s + fixed[3 * i + 1] * c;
        out[3 * i + 2] = fixed[3 * i + 2];
    }
}
static void cross(const double *a, const double *b, double *out) {
    out[0] = a[1] * b[2] - a[2] * b[1]; out[1] = a[2] * b[0] - a[0] * b[2]; out[2] = a[0] * b[1] - a[1] * b[0];
}
static void times(const double *R, const double *v, double *out) {
    for (int i = 0; i < 3; i++) out[i] = R[3 * i] * v[0] + R[3 * i + 1] * v[1] + R[3 * i + 2] * v[2];
}
static void back(const double *R, const double *v, double *out) {
    for (int i = 0; i < 3; i++) out[i] = R[i] * v[0] + R[3 + i] * v[1] + R[6 + i] * v[2];
}
static void inertial(const double *I, const double *w, double *out) {
    out[0] = I[0] * w[0] + I[3] * w[1] + I[4] * w[2];
    out[1] = I[3] * w[0] + I[1] * w[1] + I[5] * w[2];
    out[2] = I[4] * w[0] + I[5] * w[1] + I[2] * w[2];
}

/* Torques of joints for a motion; `up` is the acceleration of the base, gravity taken the other way. */
static void inverse(int n, const Link *L, double R[][9], const double *v, const double *a, const double *up, double *tau) {
    double F[MOST][3], N[MOST][3], w[3] = {0}, dw[3] = {0}, acc[3] = {up[0], up[1], up[2]};
    for (int j = 0; j < n; j++) {
        double t[3], u[3], at[3], w1[3], dw1[3];
        cross(dw, L[j].place, at); cross(w, L[j].place, t); cross(w, t, u);
        for (int i = 0; i < 3; i++) at[i] += u[i] + acc[i];
        back(R[j], at, acc); back(R[j], w, w1); back(R[j], dw, dw1);
        dw1[0] += w1[1] * v[j]; dw1[1] -= w1[0] * v[j]; dw1[2] += a[j]; w1[2] += v[j];
        memcpy(w, w1, sizeof w); memcpy(dw, dw1, sizeof dw);
        cross(dw, L[j].centre, t); cross(w, L[j].centre, u); cross(w, u, at);
        for (int i = 0; i < 3; i++) F[j][i] = L[j].mass * (acc[i] + t[i] + at[i]);
        inertial(L[j].inertia, dw, t); inertial(L[j].inertia, w, u); cross(w, u, at);
        for (int i = 0; i < 3; i++) N[j][i] = t[i] + at[i];
    }
    double f[3] = {0}, m[3] = {0};  /* by the link behind, in the frame of this one */
    for (int j = n - 1; j >= 0; j--) {
        double t[3];
        cross(L[j].centre, F[j], t);
        for (int i = 0; i < 3; i++) { m[i] += N[j][i] + t[i]; f[i] += F[j][i]; }
        tau[j] = m[2];
        double f0[3], m0[3];
        times(R[j], f, f0); times(R[j], m, m0); cross(L[j].place, f0, t);
        for (int i = 0; i < 3; i++) { f[i] = f0[i]; m[i] = m0[i] + t[i]; }
    }
}

static double height_energy(int n, const Link *L, double R[][9], const double *up) {
    double T[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, p[3] = {0}, E = 0.0;
    for (int j = 0; j < n; j++) {
        double t[3], S[9];
        times(T, L[j].place, t);
        for (int i = 0; i < 3; i++) p[i] += t[i];
        for (int i = 0; i < 3; i++) for (int k = 0; k < 3; k++)
            S[3 * i + k] = T[3 * i] * R[j][k] + T[3 * i + 1] * R[j][3 + k] + T[3 * i + 2] * R[j][6 + k];
        memcpy(T, S, sizeof T);
        times(T, L[j].centre, t);
        for (int i = 0; i < 3; i++) E += L[j].mass * up[i] * (p[i] + t[i]);
    }
    return E;
}

/* The profile of the firmware: counts, counts a tick. */
static void profile(Mind *m, const Servo *s) {
    double v = s->speed * 1e-3, a = s->acceleration * 1e-6, v0 = s->least_speed * 1e-3;
    if (!(v > 0.0)) { m->r = m->goal; return; }
    double k = floor(fabs(m->speed) / a), D = m->goal - m->r, side = sign_of(D), speed = fabs(m->speed);
    double S = 0.5 * k * (2.0 * speed - (k + 1.0) * a);
    if (!m->on_course && side * m->speed >= 0.0 && S <= fabs(D) + 1e-9) m->on_course = 1;
    if (!m->on_course) {
        double left = speed - a;
        m->speed = left <= v0 ? 0.0 : copysign(left, m->speed);
        m->r += m->speed;
        return;
    }
    speed = S >= fabs(D) - 1e-9 && speed > 0.0 ? speed - a : fmin(speed + a, v);
    speed = fmax(speed, v0);
    if (speed >= fabs(D) - 1e-9) { m->r = m->goal; m->speed = 0.0; return; }
    m->speed = side * speed;
    m->r += m->speed;
}

/* One tick; the duty that it decides. */
static double tick(Mind *m, const Servo *s, double angle) {
    double c = floor((angle + s->zero) / DELTA + 0.5);
    int feetech = s->dynamixel == 0.0;
    m->y = feetech && m->count > 0 ? cut(0.2 * m->y + 0.8 * c) : c;
    if (m->count++ == 0) { m->r = m->y; m->speed = 0.0; }
    if (isnan(m->goal)) return 0.0;
    profile(m, s);
    double e = (feetech ? cut(m->r) : m->r) - m->y;
    double z = sign_of(e) * fmax(0.0, fabs(e) - s->zone), u, full = feetech ? 1000.0 : 885.0;
    if (feetech) {
        for (int k = 20; k > 0; k--) m->z[k] = m->z[k - 1];
        m->z[0] = z;
        if (m->count % 20 == 0) {
            double change = m->z[0] - m->z[20];
            m->held = fabs(change) < 2.0 ? 0.0 : cut(s->D * change / 8.0);
        }
        u = cut(s->P * z / 4.0) + m->held;
    } else {
        m->held = cut(s->D * (z - m->z[0]) * 8.0 / s->dynamixel);
        m->z[0] = z;
        u = cut(s->P * z / s->dynamixel) + m->held;
    }
    if (u != 0.0) u += sign_of(u) * s->startup;
    double d = clip(clip(u / full, s->torque_limit), s->limit);
    if (s->slew > 0.0) d = m->duty + clip(d - m->duty, s->slew * 1e-3);
    return d;
}

static double current(const Servo *s, double d, double V, double w, double *conductance) {
    double lost = fabs(d) * s->drop + s->brush, R = s->R + fabs(d) * s->slope, x = d * V - s->K * w;
    if (fabs(x) <= lost) { *conductance = 0.0; return 0.0; }
    *conductance = 1.0 / R;
    return (x - copysign(lost, x)) / R;
}

/* Voltage of the bus under all currents, by the secant of a falling straight line with corners. */
static double bus_voltage(int n, const Servo *S, const double *d, const double *w, double V_oc, double R_b) {
    double V = V_oc, g;
    if (R_b == 0.0) return V;
    for (int round = 0; round < 6; round++) {
        double I = 0.0, slope = 0.0;
        for (int j = 0; j < n; j++) { I += d[j] * current(&S[j], d[j], V, w[j], &g); slope += d[j] * d[j] * g; }
        double off = V_oc - R_b * I - V;
        V += off / (1.0 + R_b * slope);
        if (fabs(off) < 1e-10) break;
    }
    return fmax(V, 0.0);
}

static void inverted(int n, double A[][WIDE], double X[][WIDE]) {
    double C[WIDE][WIDE] = {{0}};
    for (int i = 0; i < n; i++) for (int j = 0; j <= i; j++) {
        double x = A[i][j];
        for (int k = 0; k < j; k++) x -= C[i][k] * C[j][k];
        C[i][j] = i == j ? sqrt(x) : x / C[j][j];
    }
    for (int c = 0; c < n; c++) {
        double y[WIDE];
        for (int i = 0; i < n; i++) {
            y[i] = i == c;
            for (int k = 0; k < i; k++) y[i] -= C[i][k] * y[k];
            y[i] /= C[i][i];
        }
        for (int i = n - 1; i >= 0; i--) {
            for (int k = i + 1; k < n; k++) y[i] -= C[k][i] * y[k];
            y[i] /= C[i][i];
            X[i][c] = y[i];
        }
    }
}

/* Speeds at the end of a step whose dry friction f is within bounds and against them (Gauss-Seidel, projected). */
static void with_friction(int n, double X[][WIDE], const double *rhs, double h, const double *most_forward,
                          const double *most_backward, double *f, double *v) {
    for (int i = 0; i < n; i++) {
        v[i] = 0.0;
        for (int k = 0; k < n; k++) v[i] += X[i][k] * (rhs[k] + h * f[k]);
    }
    for (int sweep = 0; sweep < 100; sweep++) {
        double change = 0.0;
        for (int j = 0; j < n; j++) {
            double next = f[j] - v[j] / (h * X[j][j]), by;
            next = fmin(fmax(next, -most_forward[j]), most_backward[j]);
            by = next - f[j];
            if (by == 0.0) continue;
            f[j] = next;
            for (int i = 0; i < n; i++) v[i] += X[i][j] * h * by;
            change = fmax(change, fabs(by));
        }
        if (change < 1e-9) break;
    }
}

/* Energies: source, winding, bridge and brushes, wires of the supply, dry and viscous friction, pushes, teeth, and what
   motion and height gained. */
enum { SOURCE, WINDING, BRIDGE, WIRES, DRY, VISCOUS, PUSHED, TEETH, GAINED };

static double moving(int n, double M[][MOST], const Servo *S, const double *v, const double *wm) {
    double E = 0.0;
    for (int i = 0; i < n; i++) {
        E += 0.5 * S[i].J * wm[i] * wm[i];
        for (int k = 0; k < n; k++) E += 0.5 * v[i] * M[i][k] * v[k];
    }
    return E;
}

/* Run from rest at `q`; writes act at the first tick from their time on, reads give angle, speed, current, bus voltage.
   Returns 0, or 1 where something is no number. */
int run_arm(int n, const Link *L, const Servo *S, const double *up, double V_oc, double R_b, double h, double start,
            long writes, const double *write_time, const double *goals, long reads, const double *read_time,
            long pushes, const double *push, double *q, double *out, double *energy, double *most) {
    Mind mind[MOST];
    double v[MOST] = {0}, wm[MOST] = {0}, qm[MOST], a[MOST] = {0}, f[WIDE] = {0}, duty[MOST] = {0}, zero[MOST] = {0};
    double R[MOST][9], M[MOST][MOST], bias[MOST], first = 0.0;
    long done = 0, step = 0;
    int wide = 0;
    memset(mind, 0, sizeof mind);
    for (int j = 0; j < n; j++) {
        mind[j].goal = NAN; mind[j].at = NAN; qm[j] = q[j];
        mind[j].next = start + S[j].phase;
        wide = wide || S[j].play > 0.0;
    }
    for (; done < reads; step++) {
        double t = start + step * h, ext[MOST] = {0};
        for (int j = 0; j < n; j++) {  /* firmware */
            Mind *m = &mind[j];
            if (!isnan(m->at) && m->at <= t + 1e-9) { duty[j] = m->waiting; m->at = NAN; }
            if (m->next > t + 1e-9) continue;
            while (m->taken < writes && write_time[m->taken] <= t + 1e-9) {
                double g = goals[m->taken * n + j];
                m->taken++;
                if (isnan(g)) continue;
                g = floor(g / DELTA + 0.5);
                m->goal = g; m->on_course = 0;
            }
            m->duty = tick(m, &S[j], q[j]);
            m->next += 1e-3;
            if (S[j].wait > 0.0) { m->at = t + S[j].wait; m->waiting = m->duty; } else duty[j] = m->duty;
            most[j] = fmax(most[j], fabs(m->duty));
        }
        for (long k = 0; k < pushes; k++)
            if (t >= push[4 * k + 1] && t < push[4 * k + 2]) ext[(int)push[4 * k]] += push[4 * k + 3];
        for (int j = 0; j < n; j++) rotation(L[j].turn, q[j], R[j]);
        inverse(n, L, R, v, zero, up, bias);
        for (int j = 0; j < n; j++) {
            double one[MOST] = {0}, none[3] = {0}, column[MOST];
            one[j] = 1.0;
            inverse(n, L, R, zero, one, none, column);
            for (int i = 0; i < n; i++) M[i][j] = column[i] + (i == j ? S[j].wheel : 0.0);
        }
        if (step == 0) { first = moving(n, M, S, v, v) + height_energy(n, L, R, up); }
        int size = wide ? 2 * n : n;
        double A[WIDE][WIDE] = {{0}}, X[WIDE][WIDE], rhs[WIDE], forth[WIDE], backward[WIDE], u[WIDE], i0[MOST], g[MOST];
        double *w0 = wide ? wm : v, x[MOST] = {0}, contact[MOST] = {0};
        double V = bus_voltage(n, S, duty, w0, V_oc, R_b);
        for (int i = 0; i < n; i++) {
            rhs[i] = h * (ext[i] - bias[i]);
            for (int k = 0; k < n; k++) { A[i][k] = M[i][k]; rhs[i] += M[i][k] * v[k]; }
        }
        for (int j = 0; j < n; j++) {
            const Servo *s = &S[j];
            int m = wide ? n + j : j;
            i0[j] = current(s, duty[j], V, w0[j], &g[j]);
            double damping = s->K * s->K * g[j] + s->B, motor = s->K * i0[j], outside;
            A[m][m] += s->J + h * damping;
            rhs[m] = (m == j ? rhs[m] : 0.0) + s->J * w0[j] + h * (motor + s->K * s->K * g[j] * w0[j]);
            outside = ext[j] - bias[j];
            for (int k = 0; k < n; k++) if (k != j) outside -= M[j][k] * a[k];
            double bearing = 0.0;
            if (wide) {
                double gap = qm[j] - q[j], over = fabs(gap) - 0.5 * s->play;
                contact[j] = over >= 0.0;
                if (over >= 0.0) {
                    double soft = h * h * s->stiffness + h * s->damping;
                    x[j] = copysign(over, gap);
                    A[m][m] += soft; A[j][j] += soft; A[m][j] -= soft; A[j][m] -= soft;
                    rhs[m] -= h * s->stiffness * x[j]; rhs[j] += h * s->stiffness * x[j];
                } else { outside = 0.0; bearing = s->bearing; }
            }
            double load = fabs(s->load_motor * motor - s->load_external * outside);
            double S0 = w0[j] != 0.0 ? (s->stribeck > 0.0 ? exp(-fabs(w0[j]) / s->stribeck) : 0.0) : 1.0;
            double more = 1.0 + (s->breakaway - 1.0) * S0;
            forth[m] = fmax(s->forward * more + load - bearing, 0.0);
            backward[m] = fmax(s->backward * more + load - bearing, 0.0);
            if (wide) forth[j] = backward[j] = bearing;
        }
        inverted(size, A, X);
        with_friction(size, X, rhs, h, forth, backward, f, u);
        int parted = 0;
        for (int j = 0; j < n; j++) {  /* teeth push and never pull: those that would are parted, once */
            double soft = h * h * S[j].stiffness + h * S[j].damping;
            if (contact[j] == 0.0 || S[j].play == 0.0) continue;
            if ((soft * (u[n + j] - u[j]) + h * S[j].stiffness * x[j]) * (qm[j] - q[j]) >= 0.0) continue;
            A[n + j][n + j] -= soft; A[j][j] -= soft; A[n + j][j] += soft; A[j][n + j] += soft;
            rhs[n + j] += h * S[j].stiffness * x[j]; rhs[j] -= h * S[j].stiffness * x[j];
            contact[j] = 0.0;
            parted = 1;
        }
        if (parted) { inverted(size, A, X); with_friction(size, X, rhs, h, forth, backward, f, u); }
        double I = 0.0;
        for (int j = 0; j < n; j++) {
            const Servo *s = &S[j];
            int m = wide ? n + j : j;
            double i = i0[j] - s->K * g[j] * (u[m] - w0[j]);
            I += duty[j] * i;
            energy[WINDING] += h * i * i * s->R;
            energy[BRIDGE] += h * (fabs(i) * (fabs(duty[j]) * s->drop + s->brush) + fabs(duty[j]) * s->slope * i * i);
            energy[VISCOUS] += h * s->B * u[m] * u[m];
            energy[DRY] -= h * (f[m] * u[m] + (wide ? f[j] * u[j] : 0.0));
            energy[PUSHED] += h * ext[j] * u[j];
            if (contact[j] != 0.0) {
                double c = s->stiffness * (x[j] + h * (u[m] - u[j])) + s->damping * (u[m] - u[j]);
                energy[TEETH] += h * c * (u[m] - u[j]);
            }
        }
        energy[SOURCE] += h * V_oc * I;
        energy[WIRES] += h * (V_oc - V) * I;
        while (done < reads && read_time[done] < t + h) {
            double share = fmax(read_time[done] - t, 0.0);
            for (int j = 0; j < n; j++) {
                double *row = out + (done * n + j) * 4;
                row[0] = q[j] + share * u[j]; row[1] = u[j]; row[2] = i0[j]; row[3] = V;
                if (!isfinite(row[0])) return 1;
            }
            done++;
        }
        for (int j = 0; j < n; j++) {
            a[j] = (u[j] - v[j]) / h;
            v[j] = fabs(u[j]) < 1e-12 ? 0.0 : u[j];
            q[j] += h * v[j];
            wm[j] = wide ? (fabs(u[n + j]) < 1e-12 ? 0.0 : u[n + j]) : v[j];
            qm[j] = wide ? qm[j] + h * wm[j] : q[j];
        }
        if (done >= reads) {
            for (int j = 0; j < n; j++) rotation(L[j].turn, q[j], R[j]);
            energy[GAINED] = height_energy(n, L, R, up) + moving(n, M, S, v, wm) - first;
        }
    }
    return 0;
}
