// Balls from wall to wall of one box about the origin, in closed form, and of no other scene.
// events IN OUT BALLS HALF DURATION REPEATS, where centres turn round at +-HALF along each axis
// prints the CPU seconds of the fastest repeat, and the bounces
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <vector>

static const double G = 9.8;

// time to the wall ahead, at a constant speed
static double across(double x, double v, double half) { return v > 0 ? (half - x) / v : v < 0 ? (-half - x) / v : INFINITY; }

// time to the ceiling where the ball reaches it, else to the floor
static double upright(double y, double v, double half) {
    double up = v * v - 2 * G * (half - y);
    if (v > 0 && up > 0) return 2 * (half - y) / (v + std::sqrt(up));
    double root = std::sqrt(v * v + 2 * G * (y + half));
    return v > 0 ? (v + root) / G : 2 * (y + half) / (root - v);
}

int main(int, char** argument) {
    int balls = atoi(argument[3]), repeats = atoi(argument[6]);
    double half = atof(argument[4]), duration = atof(argument[5]);
    std::vector<double> start(6 * balls), end(3 * balls);
    FILE* file = fopen(argument[1], "rb");
    if (!file || fread(start.data(), sizeof(double), 6 * balls, file) != size_t(6 * balls)) return 1;

    double fastest = 1e30;
    long bounces = 0;
    for (int repeat = 0; repeat < repeats; repeat++) {
        clock_t begin = clock();
        bounces = 0;
        for (int ball = 0; ball < balls; ball++) {
            double *p = &start[3 * ball], *q = &start[3 * (balls + ball)];
            double x = p[0], y = p[1], z = p[2], vx = q[0], vy = q[1], vz = q[2], left = duration;
            for (;;) {
                double tx = across(x, vx, half), ty = upright(y, vy, half), tz = across(z, vz, half);
                double t = std::min(std::min(tx, ty), std::min(tz, left));
                x += t * vx;
                y += t * (vy - G / 2 * t);
                z += t * vz;
                vy -= G * t;
                if (t == left) break;
                if (t == tx) { x = std::copysign(half, vx); vx = -vx; }
                else if (t == ty) { y = std::copysign(half, vy); vy = -vy; }
                else { z = std::copysign(half, vz); vz = -vz; }
                left -= t;
                bounces++;
            }
            end[3 * ball] = x, end[3 * ball + 1] = y, end[3 * ball + 2] = z;
        }
        fastest = std::min(fastest, double(clock() - begin) / CLOCKS_PER_SEC);
    }
    file = fopen(argument[2], "wb");
    if (!file || fwrite(end.data(), sizeof(double), 3 * balls, file) != size_t(3 * balls) || fclose(file)) return 1;
    printf("%.9g %ld\n", fastest, bounces);
}
