/* The LHPOST6-like plant in plain C, forward Euler: a yardstick of time for `bench.py`, which compiles it.
 *
 * Equations and order of states are those of plain_loop.py, which it is compared with; four 4-way swivel actuators, six
 * 3-way bearing actuators, three struts. The platen's equations are solved in closed form in platen axes. SI units.
 */
#include <math.h>

enum { H = 4, V = 6, S = 3, N = H + V, L = H + S };

typedef struct {
    double rho[L][3], base[L][3], zero[L];              /* swivel legs and struts, platen points from C */
    double base_v[V][3], zero_v[V], plane;              /* bearing legs */
    double strut[S][4];                                 /* pressure, area, gas length, polytropic index */
    double area_a[N], curve[N], leak[N], chamber_a[N], seal[N], yield[N], shape[N], viscous[N], flow[N], w_in[N];
    double area_b[H], chamber_b[H], w_b_in[H], w_b_out[H];
    double pad[V][3];                                   /* sliding force, yield displacement, shape */
    double mass[3], weight, inertia[3][3], inverse[3][3];
    double supply, back, bulk;
} Plant;

typedef struct {
    double r[3], R[3][3], v[6], pa[N], pb[H], z[N], pad[V][2];
} State;

static double port(double high, double low) { return copysign(sqrt(fabs(high - low)), high - low); }

static void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static void step(const Plant *p, State *x, const double spool[N], double dt) {
    double (*R)[3] = x->R;
    const double *v = x->v, *w = x->v + 3;
    double u[L][3], arm[L][3], along[L], s[N], sd[N], force[3] = {0}, torque[3] = {0};
    for (int i = 0; i < L; i++) {
        double d[3], length = 0.0;
        for (int k = 0; k < 3; k++) {
            d[k] = x->r[k] - p->base[i][k];
            for (int j = 0; j < 3; j++) d[k] += R[k][j] * p->rho[i][j];
            length += d[k] * d[k];
        }
        length = sqrt(length);
        for (int k = 0; k < 3; k++) u[i][k] = (R[0][k] * d[0] + R[1][k] * d[1] + R[2][k] * d[2]) / length;
        cross(p->rho[i], u[i], arm[i]);
        double elongation = length - p->zero[i];
        if (i < H) {
            s[i] = elongation;
            sd[i] = 0.0;
            for (int k = 0; k < 3; k++) sd[i] += u[i][k] * v[k] + arm[i][k] * w[k];
        } else {
            const double *g = p->strut[i - H];
            along[i] = -g[0] * g[1] * pow(1.0 + elongation / g[2], -g[3]);
        }
    }
    /* axes of the plates, in platen axes */
    double n[3] = {R[0][2], R[1][2], R[2][2]}, cosine = sqrt(1.0 - n[1] * n[1]);
    double x_n[3] = {n[2] / cosine, 0.0, -n[0] / cosine}, y_n[3], px[3], py[3], contact[V][3], slip[V][2];
    cross(n, x_n, y_n);
    for (int k = 0; k < 3; k++) {
        px[k] = R[0][k] * x_n[0] + R[2][k] * x_n[2];
        py[k] = R[0][k] * y_n[0] + R[1][k] * y_n[1] + R[2][k] * y_n[2];
    }
    for (int i = 0; i < V; i++) {
        double e[3], m[3], at[3], rise = p->plane;
        for (int k = 0; k < 3; k++) { e[k] = x->r[k] - p->base_v[i][k]; rise += e[k] * n[k]; }
        rise /= n[2];
        double c[3] = {-e[0], -e[1], rise - e[2]};
        for (int k = 0; k < 3; k++) contact[i][k] = R[0][k] * c[0] + R[1][k] * c[1] + R[2][k] * c[2];
        cross(w, contact[i], at);
        for (int k = 0; k < 3; k++) { m[k] = v[k] + at[k]; }
        double lift = contact[i][1] * w[0] - contact[i][0] * w[1];
        s[H + i] = rise - p->zero_v[i];
        sd[H + i] = (v[2] + lift) / n[2];
        slip[i][0] = m[0] * px[0] + m[1] * px[1] + m[2] * px[2] - sd[H + i] * x_n[2];
        slip[i][1] = m[0] * py[0] + m[1] * py[1] + m[2] * py[2] - sd[H + i] * y_n[2];
    }
    double gain[N], push[V], dpa[N], dpb[H];
    for (int i = 0; i < N; i++) gain[i] = p->flow[i] * (1.0 - exp(-p->curve[i] * fabs(spool[i])));
    for (int i = 0; i < N; i++) {
        double pb = i < H ? x->pb[i] : 0.0, leak = p->leak[i] * (x->pa[i] - pb);
        double flow = spool[i] >= 0.0 ? p->w_in[i] * port(p->supply, x->pa[i]) : -port(x->pa[i], p->back);
        dpa[i] = p->bulk / (p->chamber_a[i] + s[i]) * ((gain[i] * flow - leak) / p->area_a[i] - sd[i]);
        double pull = x->pa[i] * p->area_a[i] - p->seal[i] * x->z[i] - p->viscous[i] * sd[i];
        if (i < H) {
            flow = spool[i] >= 0.0 ? -p->w_b_out[i] * port(pb, p->back) : p->w_b_in[i] * port(p->supply, pb);
            dpb[i] = p->bulk / (p->chamber_b[i] - s[i]) * ((gain[i] * flow + leak) / p->area_b[i] + sd[i]);
            along[i] = pull - pb * p->area_b[i];
        } else {
            push[i - H] = pull;
        }
    }
    for (int i = 0; i < L; i++)
        for (int k = 0; k < 3; k++) { force[k] += along[i] * u[i][k]; torque[k] += along[i] * arm[i][k]; }
    for (int i = 0; i < V; i++) {
        double f[3], t[3], rub = p->pad[i][0];
        for (int k = 0; k < 3; k++) f[k] = push[i] * R[2][k] - rub * (x->pad[i][0] * px[k] + x->pad[i][1] * py[k]);
        cross(contact[i], f, t);
        for (int k = 0; k < 3; k++) { force[k] += f[k]; torque[k] += t[k]; }
    }
    double a[6], wv[3], spin[3], turn[3];
    cross(w, v, wv);
    for (int k = 0; k < 3; k++) {
        a[k] = (force[k] - p->weight * R[2][k]) / p->mass[k] - wv[k];
        spin[k] = p->inertia[k][0] * w[0] + p->inertia[k][1] * w[1] + p->inertia[k][2] * w[2];
    }
    cross(w, spin, turn);
    for (int k = 0; k < 3; k++) {
        a[3 + k] = 0.0;
        for (int j = 0; j < 3; j++) a[3 + k] += p->inverse[k][j] * (torque[j] - turn[j]);
    }
    /* states of friction, of oil, of the platen */
    for (int i = 0; i < N; i++) {
        double q = sd[i] * x->z[i];
        x->z[i] += dt / p->yield[i] * (sd[i] - x->z[i] * (p->shape[i] * q + (1.0 - p->shape[i]) * fabs(q)));
        x->pa[i] += dt * dpa[i];
    }
    for (int i = 0; i < H; i++) x->pb[i] += dt * dpb[i];
    for (int i = 0; i < V; i++) {
        double a0 = slip[i][0] * x->pad[i][0], a1 = slip[i][1] * x->pad[i][1], shape = p->pad[i][2];
        double h = shape * (a0 + a1) + (1.0 - shape) * (fabs(a0) + fabs(a1));
        for (int k = 0; k < 2; k++) x->pad[i][k] += dt / p->pad[i][1] * (slip[i][k] - h * x->pad[i][k]);
    }
    /* exponential of the twist: to third order in the turn of one step, which is below 1e-4 */
    double t[3], square = 0.0, moved[3], Q[3][3];
    for (int k = 0; k < 3; k++) { t[k] = dt * w[k]; square += t[k] * t[k]; }
    double first = 1.0 - square / 6.0, second = 0.5 - square / 24.0, third = 1.0 / 6.0 - square / 120.0;
    double tv[3], ttv[3];
    cross(t, v, tv);
    cross(t, tv, ttv);
    for (int k = 0; k < 3; k++) moved[k] = dt * (v[k] + second * tv[k] + third * ttv[k]);
    for (int k = 0; k < 3; k++) x->r[k] += R[k][0] * moved[0] + R[k][1] * moved[1] + R[k][2] * moved[2];
    for (int i = 0; i < 3; i++) {
        double row[3] = {R[i][0], R[i][1], R[i][2]}, c[3];
        cross(row, t, c); /* row of R [t]x */
        double along_t = row[0] * t[0] + row[1] * t[1] + row[2] * t[2];
        for (int k = 0; k < 3; k++) Q[i][k] = row[k] + first * c[k] + second * (along_t * t[k] - square * row[k]);
    }
    for (int i = 0; i < 3; i++) for (int k = 0; k < 3; k++) R[i][k] = Q[i][k];
    for (int k = 0; k < 6; k++) x->v[k] += dt * a[k];
}

/* How many numbers a plant has. */
long plant_numbers(void) { return sizeof(Plant) / sizeof(double); }

/* `samples` rows of spools, `steps` steps of dt each. */
void run(const Plant *p, State *x, const double *spool, long samples, long steps, double dt) {
    for (long k = 0; k < samples; k++)
        for (long i = 0; i < steps; i++) step(p, x, spool + N * k, dt);
}
