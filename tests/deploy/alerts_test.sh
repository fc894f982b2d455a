#!/usr/bin/env bash
# The alert rules use metrics that the server has, and each alert is in the runbook. With promtool, their syntax is
# checked too.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
rules=$root/deploy/monitoring/alerts.yaml
status=0
for metric in $(grep -o 'romap_[a-z_]*' "$rules" | sed 's/_bucket$//' | sort -u); do
  grep -rqF "\"$metric\"" "$root/server/http" || { echo "$metric: no metric of server/http"; status=1; }
done
alerts=$(sed -n 's/.*- alert: //p' "$rules")
[ -n "$alerts" ] || { echo "no alerts found in $rules"; exit 1; }
for alert in $alerts; do
  grep -qF "| \`$alert\` |" "$root/deploy/runbook.md" || { echo "$alert: not in deploy/runbook.md"; status=1; }
done
if command -v promtool >/dev/null; then promtool check rules "$rules" || status=1; fi
exit $status
