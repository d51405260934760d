#include "client/cli/man_page.h"

namespace planish::cli {

ManFrame ManPage() {
  return {1, "User Commands", R"(.SH SYNOPSIS
.B planish unwrap
.I IN
.B \-o
.I OUT
.RI [ OPTIONS ]
.br
.B planish
.I COMMAND
.RI [ OPTIONS ]
.SH DESCRIPTION
.B planish
sends triangle meshes to a
.BR planishd (8)
server, shows the progress of their unwrapping, and writes the texture coordinates into a copy of the file. Without
.B \-\-server
it starts a private server for the life of the command.
.PP
Results go to standard output, what is for people to standard error.
)",
          R"(.SH ENVIRONMENT
.TP
.B PLANISH_SERVER
The server, where
.B \-\-server
does not name one.
.TP
.BR PLANISH_TLS ", " PLANISH_TLS_CA ", " PLANISH_TLS_CERT ", " PLANISH_TLS_KEY ", " PLANISH_TOKEN ", " PLANISH_TOKEN_FILE
How to reach it safely, and as whom, where flags do not say so.
.TP
.B PLANISH_CONFIG
The configuration file; empty: none.
.TP
.BR NO_COLOR ", " TERM
Whether standard error gets colours and bars.
.SH CONFIGURATION
The file that
.B PLANISH_CONFIG
names, or
.I $XDG_CONFIG_HOME/planish.toml
(without that variable
.IR ~/.config/planish.toml ),
holds flags that are added to every call which does not have them: names without dashes, for all commands that have such a flag, or
below the name of a command for that one.
.PP
.nf
server = "farm:7741"
color = "never"
[unwrap]
texture\-size = 2048
[jobs.list]
limit = 10
.fi
.PP
Flags go over variables, and variables over the file.
.SH FILES
.TP
.I ~/.config/planish.toml
Settings for every call, see CONFIGURATION.
.TP
.I OUT/.planish\-batch.json
What a batch has done, by which the same command goes on where it ended.
.SH EXIT STATUS
.TP
.B 0
A usable map, or whatever else was asked for.
.TP
.B 1
The job failed, or its map is not usable (it is written all the same).
.TP
.B 2
Bad usage, or input that cannot be read.
.TP
.B 3
The server cannot be reached, or its queue is full.
.TP
.B 130
Interrupted. The first Ctrl\-C cancels the job on the server, a second one leaves at once.
.SH SEE ALSO
.BR planishd (8)
)"};
}

}  // namespace planish::cli
