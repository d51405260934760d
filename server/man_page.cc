#include "server/man_page.h"

namespace planish {

ManFrame ManPage() {
  return {8, "System Administration", R"(.SH SYNOPSIS
.B planishd
.RI [ OPTIONS ]
.SH DESCRIPTION
.B planishd
takes triangle meshes over gRPC, queues them as jobs, and unwraps them in worker processes of its own. It listens on
this machine only unless told otherwise.
)",
          R"(.SH ENVIRONMENT
Every option that is a setting may also be a variable:
.B PLANISHD_
and its name in capitals, with underscores for dashes
.RB ( PLANISHD_MEMORY_MB
for
.BR \-\-memory\-mb ).
Flags go over variables, and variables over the file.
.SH FILES
.TP
.I /etc/planish/planishd.yaml
The file that the systemd unit and the image name with
.BR \-\-config :
the same names as keys.
.TP
.I DIR/jobs.sqlite, DIR/blobs, DIR/uploads
What
.B \-\-data\-dir
holds. One server at a time.
.SH SIGNALS
.TP
.BR SIGTERM ", " SIGINT
Refuse new jobs, give those that were accepted
.B \-\-grace
seconds, then end. A second one ends the grace.
.TP
.B SIGHUP
Read configuration, certificates and access file anew. What cannot change while it runs is told in the log.
.SH EXIT STATUS
.TP
.B 0
It ended as it was told to.
.TP
.B 2
Bad usage, a configuration that is wrong, or an address that cannot be had.
.SH SEE ALSO
.BR planish (1)
)"};
}

}  // namespace planish
