# docker build -t schuler . && docker run --rm -v "$PWD/out:/out" schuler
# Runs the demo; another command after the image's name, as: docker run --rm -v "$PWD:/data" schuler align /data/truck.csv ...
FROM python:3.12-slim
COPY . /src
RUN pip install --no-cache-dir "/src[report,plot]" && rm -rf /src \
    && useradd --create-home schuler && mkdir /out && chown schuler /out
USER schuler
ENTRYPOINT ["schuler"]
CMD ["demo", "--out", "/out"]
