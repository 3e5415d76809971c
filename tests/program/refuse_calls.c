/* refuse_calls EPERM|ENOSYS CALL,.. COMMAND...: runs a command whose system calls of these names (memfd_create, pidfd_open, clone)
 * are refused with this error, as by the seccomp filter of a container. Ends with 77 where the system has no such filters. */
#include <errno.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

static const struct { const char *name; unsigned number; } calls[] = {
  {"memfd_create", SYS_memfd_create}, {"pidfd_open", SYS_pidfd_open}, {"clone", SYS_clone}, {"clone", SYS_clone3}};

int main(int count, char **words)
{
  if (count < 4) return 2;
  const unsigned error = strcmp(words[1], "ENOSYS") == 0 ? ENOSYS : EPERM;
  struct sock_filter filter[10] = {BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(struct seccomp_data, nr))};
  unsigned short size = 1;
  for (size_t i = 0; i < sizeof calls / sizeof *calls; ++i) {
    if (!strstr(words[2], calls[i].name)) continue;
    filter[size++] = (struct sock_filter)BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, calls[i].number, 0, 1);
    filter[size++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | error);
  }
  filter[size++] = (struct sock_filter)BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW);
  struct sock_fprog program = {size, filter};
  if (size == 2 || prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0) {
    perror("refuse_calls");
    return 77;
  }
  execvp(words[3], words + 3);
  perror(words[3]);
  return 2;
}
