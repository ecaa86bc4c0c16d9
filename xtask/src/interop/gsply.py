# Converts a splat file to another by their endings: FROM TO SPZ_VERSION.
import sys
import gsply

source, target, version = sys.argv[1:]
data = gsply.read_spz(source) if source.endswith(".spz") else gsply.plyread(source)
if target.endswith(".spz"):
    gsply.write_spz(target, data, version=int(version))
else:
    gsply.plywrite(target, data, compressed=target.endswith(".compressed.ply"))
