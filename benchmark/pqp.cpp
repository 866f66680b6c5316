// A C interface to PQP's public one, for pqp.py: a model, and one question at many poses, timed.
#include <time.h>

#include "PQP.h"

static double seconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec + 1e-9 * now.tv_nsec;
}

static void take(const double *pose, PQP_REAL rotation[3][3], PQP_REAL translation[3]) {
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) rotation[i][j] = pose[4 * i + j];
    translation[i] = pose[4 * i + 3];
  }
}

extern "C" {

// A model of `count` triangles, nine numbers each.
void *make_model(const double *corners, long count) {
  PQP_Model *model = new PQP_Model;
  model->BeginModel(count);
  for (long i = 0; i < count; i++, corners += 9)
    model->AddTri(corners, corners + 3, corners + 6, i);
  model->EndModel();
  return model;
}

void free_model(void *model) { delete static_cast<PQP_Model *>(model); }

// Asks at `count` poses (4 x 4 each): for the distances to a relative error; or, where `clearance`
// is not negative, whether they are within it, 1 or 0. `queue` is PQP's size of its priority queue,
// 2 for a search depth first; `cached` keeps its triangles from one question to the next.
// Returns the seconds that took, and adds up its bound tests.
double ask(void *a, void *b, const double *poses_a, const double *poses_b, long count,
           double relative, double clearance, int queue, int cached, double *answers, long *tests) {
  PQP_Model *first = static_cast<PQP_Model *>(a), *second = static_cast<PQP_Model *>(b);
  PQP_REAL rotation_a[3][3], at_a[3], rotation_b[3][3], at_b[3];
  const double begun = seconds();
  for (long i = 0; i < count; i++) {
    take(poses_a + 16 * i, rotation_a, at_a);
    take(poses_b + 16 * i, rotation_b, at_b);
    if (!cached) {
      first->last_tri = first->tris;
      second->last_tri = second->tris;
    }
    if (clearance >= 0.0) {
      PQP_ToleranceResult found;
      PQP_Tolerance(&found, rotation_a, at_a, first, rotation_b, at_b, second, clearance, queue);
      answers[i] = found.CloserThanTolerance();
      *tests += found.NumBVTests();
    } else {
      // PQP prunes where both errors allow it.
      const double absolute = relative > 0.0 ? 1e30 : 0.0;
      PQP_DistanceResult found;
      PQP_Distance(&found, rotation_a, at_a, first, rotation_b, at_b, second, relative, absolute,
                   queue);
      answers[i] = found.Distance();
      *tests += found.NumBVTests();
    }
  }
  return seconds() - begun;
}
}
