"""Prints what a release consists of and needs, as SPDX 2.3 in JSON: sbom.py VERSION FOLDER."""

import datetime
import hashlib
import json
import pathlib
import re
import subprocess
import sys
import zipfile


def output(*command):
    return subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE).stdout


def package(name, version, **more):
    return {"SPDXID": f"SPDXRef-{re.sub('[^A-Za-z0-9.-]', '-', name)}", "name": name,
            "versionInfo": version, "downloadLocation": "NOASSERTION", "filesAnalyzed": False,
            "licenseDeclared": "NOASSERTION", **more}


def libraries(path):
    """Returns the names of the Debian packages on which one depends, or whose libraries a wheel contains."""
    if path.suffix == ".whl":  # ./run python puts their licences there
        parts = [name.rpartition("/") for name in zipfile.ZipFile(path).namelist()]
        return {name for folder, _, name in parts if folder.endswith("/licenses/bundled")}
    if path.suffix != ".deb":
        return set()
    depends = output("dpkg-deb", "--field", str(path), "Depends").split(",")
    names = {re.split(r"[ (|]", part.strip())[0] for part in depends}
    return {name for name in names if name and "dashpot" not in name}


def versions(names):
    """Returns Debian packages with the versions of this machine."""
    lines = output("dpkg-query", "-W", "-f", "${Package} ${Version}\n", *sorted(names)) if names else ""
    return {name: package(name, version, externalRefs=[{
        "referenceCategory": "PACKAGE-MANAGER", "referenceType": "purl",
        "referenceLocator": f"pkg:deb/debian/{name}@{version}"}])
        for name, version in (line.split() for line in lines.splitlines())}


def main():
    version, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    files = [package(path.name, version, packageFileName=path.name, licenseDeclared="BSD-3-Clause",
                     checksums=[{"algorithm": "SHA256",
                                 "checksumValue": hashlib.sha256(path.read_bytes()).hexdigest()}])
             for path in sorted(folder.iterdir())]
    needed = {file["name"]: libraries(folder / file["name"]) for file in files}
    known = versions(set().union(*needed.values()))
    relations = [("SPDXRef-DOCUMENT", "DESCRIBES", file) for file in files]
    relations += [(file["SPDXID"], "CONTAINS" if file["name"].endswith(".whl") else "DEPENDS_ON", known[name])
                  for file in files for name in sorted(needed[file["name"]])]
    json.dump({
        "spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT",
        "name": f"dashpot-{version}",
        "documentNamespace": f"https://spdx.org/spdxdocs/dashpot-{version}-"
                             + hashlib.sha256(json.dumps(files).encode()).hexdigest()[:16],
        "creationInfo": {"created": datetime.datetime.now(datetime.timezone.utc)
                         .strftime("%Y-%m-%dT%H:%M:%SZ"), "creators": ["Tool: dashpot-sbom"]},
        "packages": files + list(known.values()),
        "relationships": [{"spdxElementId": one, "relationshipType": kind,
                           "relatedSpdxElement": other["SPDXID"]} for one, kind, other in relations],
    }, sys.stdout, indent=2)
    print()


main()
