// Balls in fixed steps, each tested against every triangle in every step: what one writes by hand without a tree or a bound.
// fixed_step IN OUT BALLS TRIANGLES RADIUS STEP STEPS VERLET REPEATS; prints the seconds of the fastest repeat and the bounces
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <vector>

struct V { double x, y, z; };
static V operator+(V a, V b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
static V operator-(V a, V b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
static V operator*(double s, V a) { return {s * a.x, s * a.y, s * a.z}; }
static double dot(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static V cross(V a, V b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

// normal . x = offset is its plane moved out by the radius; u and v are coordinates along two sides, 0 to 1 at their ends
struct Triangle { V normal, u, v; double offset, u0, v0; };

static Triangle triangle(const V* corner, double radius) {
    V a = corner[1] - corner[0], b = corner[2] - corner[0], n = cross(a, b);
    V u = (1 / dot(n, n)) * cross(b, n), v = (1 / dot(n, n)) * cross(n, a);
    n = (1 / __builtin_sqrt(dot(n, n))) * n;
    return {n, u, v, dot(n, corner[0]) + radius, dot(u, corner[0]), dot(v, corner[0])};
}

int main(int, char** argument) {
    int balls = atoi(argument[3]), faces = atoi(argument[4]), steps = atoi(argument[7]), repeats = atoi(argument[9]);
    double radius = atof(argument[5]), h = atof(argument[6]);
    bool verlet = atoi(argument[8]);
    std::vector<V> start(2 * balls), corners(3 * faces), end(balls);
    FILE* file = fopen(argument[1], "rb");
    if (!file || fread(start.data(), sizeof(V), 2 * balls, file) != size_t(2 * balls)) return 1;
    if (fread(corners.data(), sizeof(V), 3 * faces, file) != size_t(3 * faces)) return 1;
    std::vector<Triangle> triangles;
    for (int k = 0; k < faces; k++) triangles.push_back(triangle(&corners[3 * k], radius));

    const V g = {0, -9.8, 0};
    double fastest = 1e30;
    long bounces = 0;
    for (int repeat = 0; repeat < repeats; repeat++) {
        auto begin = std::chrono::steady_clock::now();
        bounces = 0;
        for (int ball = 0; ball < balls; ball++) {
            V x = start[ball], v = start[balls + ball];
            for (int step = 0; step < steps; step++) {
                double left = h;
                if (!verlet) v = v + h * g;  // symplectic Euler
                for (;;) {
                    V path = left * v + (verlet ? left * left / 2 : 0) * g;  // of Verlet the chord of its parabola
                    const Triangle* hit = nullptr;
                    double nearest = 1;
                    for (const Triangle& t : triangles) {
                        double toward = dot(t.normal, path);
                        if (toward >= 0) continue;
                        double s = (t.offset - dot(t.normal, x)) / toward;
                        if (s < -1e-9 || s > nearest) continue;
                        V at = x + s * path;
                        double a = dot(t.u, at) - t.u0, b = dot(t.v, at) - t.v0;
                        if (a >= 0 && b >= 0 && a + b <= 1) { nearest = s; hit = &t; }
                    }
                    x = x + nearest * path;
                    if (verlet) v = v + nearest * left * g;
                    if (!hit) break;
                    v = v - 2 * dot(v, hit->normal) * hit->normal;
                    left *= 1 - nearest;
                    bounces++;
                }
            }
            end[ball] = x;
        }
        fastest = std::min(fastest, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    }
    file = fopen(argument[2], "wb");
    if (!file || fwrite(end.data(), sizeof(V), balls, file) != size_t(balls) || fclose(file)) return 1;
    printf("%.9g %ld\n", fastest, bounces);
}
