/* A library of Force Dimension that is not what the driver needs: with the version that a variable of the environment names, and
 * without all other functions. */
#include <stdio.h>
#include <stdlib.h>

void dhdGetSDKVersion(int *major, int *minor, int *release, int *revision);
void dhdGetSDKVersion(int *major, int *minor, int *release, int *revision)
{
  const char *const version = getenv("OLD_DRD_VERSION");
  *major = *minor = *release = *revision = 0;
  if (version) sscanf(version, "%d.%d", major, minor);
}
