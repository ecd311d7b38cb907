// Preloaded into gzserver: it dies with the process that started it, and listens on the loopback interface only.

#include <arpa/inet.h>
#include <dlfcn.h>
#include <netinet/in.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

namespace {

__attribute__((constructor)) void live_with_parent() {
  const char *parent = getenv("DUBINS_TRAFFIC_GAZEBO_PARENT");
  if (parent == nullptr || *parent == 0) return;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != atoi(parent)) _exit(3);
}

}  // namespace

// Gazebo binds its sockets to every interface and has no setting for that.
extern "C" int bind(int file, const sockaddr *address, socklen_t length) {
  using Bind = int (*)(int, const sockaddr *, socklen_t);
  static const Bind next = reinterpret_cast<Bind>(dlsym(RTLD_NEXT, "bind"));
  if (address->sa_family != AF_INET || length < sizeof(sockaddr_in)) return next(file, address, length);
  sockaddr_in local;
  memcpy(&local, address, sizeof local);
  local.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return next(file, reinterpret_cast<const sockaddr *>(&local), sizeof local);
}
