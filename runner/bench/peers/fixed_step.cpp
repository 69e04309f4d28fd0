// Balls in fixed steps, each tested against every triangle in every step: what one writes by hand without a tree or a bound.
// fixed_step IN OUT BALLS TRIANGLES RADIUS STEP STEPS VERLET PREPARED REPEATS
// prints the CPU seconds of the fastest repeat, and the bounces
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

struct V { double x, y, z; };
static V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
static V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static V operator*(double s, V a) { return {s * a.x, s * a.y, s * a.z}; }
static double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

// A triangle moved out by the ball's radius: a corner, two sides, and prepared from them its plane normal . x = offset and
// u, v with which its points have coordinates u . x - u0, v . x - v0 from 0 to 1.
struct Triangle { V corner, a, b, normal, u, v; double offset, u0, v0; };

static Triangle triangle(const V* corner, double radius) {
    V a = corner[1] - corner[0], b = corner[2] - corner[0], n = cross(a, b);
    V u = (1 / dot(n, n)) * cross(b, n), v = (1 / dot(n, n)) * cross(n, a);
    n = (1 / std::sqrt(dot(n, n))) * n;
    V moved = corner[0] + radius * n;
    return {moved, a, b, n, u, v, dot(n, moved), dot(u, moved), dot(v, moved)};
}

const double BEFORE = -1e-9;  // of a path: a ball that has just been put onto a wall may be behind it by rounding

// The part of the path from x after which the ray meets the front of the triangle, or `none`: Moller and Trumbore's test.
static double meet(const Triangle& t, V x, V path, double none) {
    V p = cross(path, t.b);
    double det = dot(t.a, p);
    if (det <= 0) return none;
    V off = x - t.corner;
    double u = dot(off, p);
    if (u < 0 || u > det) return none;
    V q = cross(off, t.a);
    double v = dot(path, q);
    if (v < 0 || u + v > det) return none;
    double s = dot(t.b, q) / det;
    return s >= BEFORE ? s : none;
}

// The same by what is prepared: most triangles are told by the distance to their plane alone.
static double meet_prepared(const Triangle& t, V x, V path, double none) {
    double toward = dot(t.normal, path);
    if (toward >= 0) return none;
    double s = (t.offset - dot(t.normal, x)) / toward;
    if (s < BEFORE || s >= none) return none;
    V at = x + s * path;
    double a = dot(t.u, at) - t.u0, b = dot(t.v, at) - t.v0;
    return a >= 0 && b >= 0 && a + b <= 1 ? s : none;
}

// Move balls from `start`, places then velocities, to `end`; returns the bounces.
template <bool VERLET, bool PREPARED>
static long move(const std::vector<V>& start, const std::vector<Triangle>& triangles, double h, int steps, std::vector<V>& end) {
    const V g = {0, -9.8, 0};
    long bounces = 0;
    for (size_t ball = 0; ball < end.size(); ball++) {
        V x = start[ball], v = start[end.size() + ball];
        for (int step = 0; step < steps; step++) {
            double left = h;
            if (!VERLET) v = v + h * g;  // symplectic Euler
            for (;;) {
                V path = left * v + (VERLET ? left * left / 2 : 0) * g;  // of Verlet the chord of its parabola
                const Triangle* hit = nullptr;
                double nearest = 1;
                for (const Triangle& t : triangles) {
                    double s = PREPARED ? meet_prepared(t, x, path, nearest) : meet(t, x, path, nearest);
                    if (s < nearest) { nearest = s; hit = &t; }
                }
                x = x + nearest * path;
                if (VERLET) v = v + nearest * left * g;
                if (!hit) break;
                v = v - 2 * dot(v, hit->normal) * hit->normal;
                left *= 1 - nearest;
                bounces++;
            }
        }
        end[ball] = x;
    }
    return bounces;
}

int main(int, char** argument) {
    int balls = atoi(argument[3]), faces = atoi(argument[4]), steps = atoi(argument[7]), repeats = atoi(argument[10]);
    double radius = atof(argument[5]), h = atof(argument[6]);
    bool verlet = atoi(argument[8]), prepared = atoi(argument[9]);
    std::vector<V> start(2 * balls), corners(3 * faces), end(balls);
    FILE* file = fopen(argument[1], "rb");
    if (!file || fread(start.data(), sizeof(V), 2 * balls, file) != size_t(2 * balls)) return 1;
    if (fread(corners.data(), sizeof(V), 3 * faces, file) != size_t(3 * faces)) return 1;
    std::vector<Triangle> triangles;
    for (int k = 0; k < faces; k++) triangles.push_back(triangle(&corners[3 * k], radius));

    auto moving = verlet ? (prepared ? move<true, true> : move<true, false>) : (prepared ? move<false, true> : move<false, false>);
    double fastest = 1e30;
    long bounces = 0;
    for (int repeat = 0; repeat < repeats; repeat++) {
        clock_t begin = clock();
        bounces = moving(start, triangles, h, steps, end);
        fastest = std::min(fastest, double(clock() - begin) / CLOCKS_PER_SEC);
    }
    file = fopen(argument[2], "wb");
    if (!file || fwrite(end.data(), sizeof(V), balls, file) != size_t(balls) || fclose(file)) return 1;
    printf("%.9g %ld\n", fastest, bounces);
}
