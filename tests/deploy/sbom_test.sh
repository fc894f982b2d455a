#!/usr/bin/env bash
# sbom_test.sh BUILD_DIR ROMAP_SERVER: the list of the software's parts is valid SPDX in its main fields, has a version
# for each library, and names every package of deploy/setup.sh that ends in -dev.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
python3 - "$1/romap.spdx.json" "$root/deploy/setup.sh" <<'PYTHON'
import json, re, sys
sbom = json.load(open(sys.argv[1]))
assert sbom['spdxVersion'] == 'SPDX-2.3' and sbom['dataLicense'] == 'CC0-1.0' and sbom['SPDXID'] == 'SPDXRef-DOCUMENT'
assert re.fullmatch(r'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ', sbom['creationInfo']['created']), sbom['creationInfo']
ids = [package['SPDXID'] for package in sbom['packages']]
assert len(ids) == len(set(ids)) and all(re.fullmatch(r'SPDXRef-[A-Za-z0-9.-]+', i) for i in ids), ids
for package in sbom['packages']:
    assert re.search(r'\d', package['versionInfo']), package
    assert package['licenseDeclared'], package
for relation in sbom['relationships']:
    assert relation['relatedSpdxElement'] in ids, relation
assert len(sbom['relationships']) == len(ids)
setup = open(sys.argv[2]).read()
needed = set(re.findall(r'\S+-dev\b', setup[setup.index('packages=('):setup.index(')')]))
# Parts of packages that are listed.
needed -= {'libgrpc-dev', 'libopencv-contrib-dev'}
locators = ' '.join(ref['referenceLocator'] for p in sbom['packages'] for ref in p.get('externalRefs', []))
missing = [name for name in needed if 'pkg:deb/debian/' + name.replace('+', '%2B') + '@' not in locators]
assert needed and not missing, missing
assert 'pkg:npm/three@' in locators
PYTHON
text=$("$2" --version --verbose)
grep -qE '^OpenCV [0-9]' <<<"$text"
grep -qE '^gRPC [0-9]' <<<"$text"
