// Preloaded into a program (LD_PRELOAD) to imitate a slow or failing disk. The file that ROMAP_TEST_DISK names contains
// one rule, which every call obeys anew:
//
//   delay MILLISECONDS   fsync(), fdatasync() and remove() take so much longer
//   hang                 they do not return until the rule changes
//   fail ERRNO [PART]    fsync() and fdatasync() fail, only for files whose path contains PART if it is given
//
// An empty or missing file: everything works.

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static void ReadRule(char* rule, size_t size) {
  rule[0] = '\0';
  const char* path = getenv("ROMAP_TEST_DISK");
  const int fd = path == NULL ? -1 : open(path, O_RDONLY | O_CLOEXEC);
  if (fd < 0) return;
  const ssize_t bytes = read(fd, rule, size - 1);
  rule[bytes > 0 ? bytes : 0] = '\0';
  close(fd);
}

static void Sleep(int milliseconds) {
  struct timespec left = {milliseconds / 1000, milliseconds % 1000 * 1000000L};
  while (nanosleep(&left, &left) != 0 && errno == EINTR) {
  }
}

// The error that the rule demands for `fd`; 0: none.
static int Obey(int fd) {
  char rule[256], part[128] = "";
  int number = 0;
  ReadRule(rule, sizeof(rule));
  if (sscanf(rule, "delay %d", &number) == 1) Sleep(number);
  while (strncmp(rule, "hang", 4) == 0) {
    Sleep(5);
    ReadRule(rule, sizeof(rule));
  }
  if (fd < 0 || sscanf(rule, "fail %d %127s", &number, part) < 1) return 0;
  char link[64], path[512];
  snprintf(link, sizeof(link), "/proc/self/fd/%d", fd);
  const ssize_t bytes = readlink(link, path, sizeof(path) - 1);
  path[bytes > 0 ? bytes : 0] = '\0';
  return strstr(path, part) != NULL ? number : 0;
}

static int Sync(const char* name, int fd) {
  int error = Obey(fd);
  if (error == 0) {
    int (*real)(int) = (int (*)(int))dlsym(RTLD_NEXT, name);
    return real(fd);
  }
  errno = error;
  return -1;
}

int fsync(int fd) { return Sync("fsync", fd); }
int fdatasync(int fd) { return Sync("fdatasync", fd); }
int remove(const char* path) {
  Obey(-1);
  int (*real)(const char*) = (int (*)(const char*))dlsym(RTLD_NEXT, "remove");
  return real(path);
}
