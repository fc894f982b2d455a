#!/usr/bin/env bash
# The alert rules and the dashboard use metrics that the server has, each metric is on the dashboard, and each alert is
# in the runbook. With promtool, the syntax of the rules is checked too.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
rules=$root/deploy/monitoring/alerts.yaml
dashboard=$root/deploy/monitoring/dashboard.json
status=0
python3 -m json.tool "$dashboard" >/dev/null || status=1
metrics=$(grep -rhoE '"(romap|process)_[a-z_]+"' "$root"/server/http/metrics.cc | tr -d '"' | sort -u)
[ -n "$metrics" ] || { echo "no metrics found in server/http"; exit 1; }
for file in "$rules" "$dashboard"; do
  for metric in $(grep -oE '(romap|process)_[a-z_]+[a-z]' "$file" | sed 's/_bucket$//' | sort -u); do
    grep -qxF "$metric" <<<"$metrics" || { echo "$metric in $file: no metric of server/http"; status=1; }
  done
done
for metric in $metrics; do
  grep -qF "$metric" "$dashboard" || { echo "$metric: not on the dashboard"; status=1; }
done
alerts=$(sed -n 's/.*- alert: //p' "$rules")
[ -n "$alerts" ] || { echo "no alerts found in $rules"; exit 1; }
for alert in $alerts; do
  grep -qF "| \`$alert\` |" "$root/deploy/runbook.md" || { echo "$alert: not in deploy/runbook.md"; status=1; }
done
if command -v promtool >/dev/null; then promtool check rules "$rules" || status=1; fi
exit $status
