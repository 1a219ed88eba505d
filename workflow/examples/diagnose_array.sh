#!/bin/sh
# Diagnose many campaigns on Slurm, each in a job of its own. folders.txt has the folder of a campaign on each line:
#
#     sbatch --array=1-"$(wc -l < folders.txt)" diagnose_array.sh folders.txt
#
# Submit it where the results shall lie: in a checkout, or in any folder if elastocal is installed.
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
#SBATCH --time=60
#SBATCH --output=diagnose-%a.log
folder=$(sed -n "${SLURM_ARRAY_TASK_ID}p" "$1")
exec elastocal diagnose "$folder" --cores 1
