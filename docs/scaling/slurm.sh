#!/usr/bin/env bash
# One part of a c4d command for each task of a SLURM array:
#
#   sbatch --array=1-20 slurm.sh PARTS render RUN --cameras orbit
#   sbatch --dependency=afterok:JOB --wrap "c4d gather PARTS/* -o clip.mp4"
#
# PARTS must be on a file system that all nodes share. A task that is repeated, for example after its node failed, replaces its part.
#SBATCH --job-name=c4d
#SBATCH --cpus-per-task=8
set -euo pipefail

parts=$1
shift
part=$((SLURM_ARRAY_TASK_ID - SLURM_ARRAY_TASK_MIN + 1))
mkdir -p "$parts"
exec c4d "$@" --part "$part/$SLURM_ARRAY_TASK_COUNT" -o "$parts/$part" -w --no-progress --threads "${SLURM_CPUS_PER_TASK:-1}"
